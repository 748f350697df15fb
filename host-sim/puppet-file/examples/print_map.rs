//! Prints the joint map of a puppet.toml, and its bytes.
//!
//! ```console
//! $ cargo run -p puppet-file --example print_map puppets/sample.toml [SKELETON.asf]
//! ```
//!
//! Without a skeleton, in the file or as the second argument, channels are numbered as `bunraku encode --puppet` puts
//! them into a clip: those that the joints follow, in the order of the file.

use puppet_file::{Channels, Puppet, to_bytes};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let path = arguments.next().ok_or("expected the path of a puppet.toml")?;
    let skeleton = arguments.next();
    let puppet = Puppet::read(&path)?;
    let channels = channels(&puppet, skeleton.as_deref())?;
    let map = match puppet.check(channels.clone()) {
        Ok(map) => map,
        Err(mistakes) => {
            mistakes.iter().for_each(|mistake| eprintln!("{mistake}"));
            return Ok(ExitCode::FAILURE);
        }
    };
    println!("{} goals a second", map.tick_hz());
    for (name, bus) in puppet.bus_names().iter().zip(map.buses()) {
        println!("bus {name}: {:?}, {} baud", bus.kind, bus.baud);
    }
    for joint in map.joints() {
        let channel = channels.name(joint.channel.into());
        println!(
            "bus {}, servo {:3}: {}, channel {} ({channel}), goals {} to {}, zero {}, {} goals a unit",
            joint.bus,
            joint.id,
            puppet.name_of(joint),
            joint.channel,
            joint.min,
            joint.max,
            joint.zero,
            joint.scale,
        );
    }
    let bytes: Vec<String> = to_bytes(&map).iter().map(|byte| format!("{byte:02x}")).collect();
    println!("{} bytes: {}", bytes.len(), bytes.concat());
    Ok(ExitCode::SUCCESS)
}

fn channels(puppet: &Puppet, skeleton: Option<&Path>) -> Result<Channels, Box<dyn Error>> {
    match skeleton.map(Path::to_owned).or_else(|| puppet.skeleton()) {
        Some(path) => Ok(Channels::from(&mocap::import::load_skeleton(&path)?)),
        None => Ok(puppet.channels()?),
    }
}
