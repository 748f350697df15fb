//! `bunraku puppet new`.

use super::super::input::Recording;
use anyhow::{Result, bail};
use firmware::map::BusKind;
use host_sim::files;
use host_sim::puppet::new::{Group, Wish, propose, text};
use puppet_file::Puppet;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a first puppet.toml for the figure of a recording: its joints, ranges and speeds.
///
/// What the joints follow are parts of the body, so the file serves other recordings too. Ids, and the direction in
/// which each servo is mounted, are yours to fill in.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku puppet new walk.bvh -o puppet.toml\n  bunraku puppet new 02_01.amc --skeleton 02.asf --joints head,arms --kind sts -o puppet.toml\n  bunraku puppet new walk.bvh --servos 6 -o puppet.toml"
)]
pub struct Args {
    /// The recording: .bvh, .amc, .glb or .gltf.
    input: PathBuf,
    #[command(flatten)]
    recording: Recording,
    /// The parts that the puppet has: head, arms, legs, waist; all unless given.
    #[arg(long, value_name = "PARTS", value_delimiter = ',', value_parser = group)]
    joints: Vec<Group>,
    /// Most servos: those that move most in the recording are taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=200))]
    servos: Option<u8>,
    /// What the servos speak: dynamixel, dynamixel1, sts, scs, pwm, pca9685 or blender.
    #[arg(long, default_value = "dynamixel", value_parser = kind)]
    kind: BusKind,
    /// Write over a file that is there already.
    #[arg(long)]
    force: bool,
    /// Where the puppet goes.
    #[arg(short, long, value_name = "PUPPET.toml")]
    output: PathBuf,
}

fn group(name: &str) -> Result<Group, String> {
    let names: Vec<&str> = Group::ALL.iter().map(|group| group.name()).collect();
    let found = Group::ALL.into_iter().find(|group| group.name() == name);
    found.ok_or_else(|| format!("found {name:?}, expected {}", names.join(", ")))
}

fn kind(name: &str) -> Result<BusKind, String> {
    let names: Vec<&str> = BusKind::ALL.iter().map(|kind| kind.name()).collect();
    BusKind::from_name(name).ok_or_else(|| format!("found {name:?}, expected {}", names.join(", ")))
}

pub fn run(args: Args) -> Result<ExitCode> {
    if args.output.exists() && !args.force {
        bail!("{} is there already: name another file, or write over it with --force", args.output.display());
    }
    let clip = args.recording.load(&args.input)?;
    let wish = Wish {
        groups: if args.joints.is_empty() { Group::ALL.to_vec() } else { args.joints },
        // A PCA9685 has so many outputs.
        servos: match args.kind {
            BusKind::Pca9685 => Some(args.servos.map_or(16, usize::from).min(16)),
            _ => args.servos.map(usize::from),
        },
        kind: args.kind,
    };
    let proposal = match propose(&clip, &wish) {
        Ok(proposal) => proposal,
        Err(error) => bail!("{}: {error}", args.input.display()),
    };
    let name = args.input.file_name().unwrap_or(args.input.as_os_str()).to_string_lossy();
    let text = text(&proposal, &name);
    // What we write is read before it is there.
    Puppet::parse(&args.output, text.clone())?;
    files::write_over(&args.output, args.force, |file| Ok(file.write_all(text.as_bytes())?))?;
    for note in &proposal.notes {
        eprintln!("bunraku: {}: {note}", args.input.display());
    }
    let joints: Vec<&str> =
        proposal.units.iter().flat_map(|unit| &unit.joints).map(|joint| joint.name.as_str()).collect();
    println!("{}: {} servos: {}", args.output.display(), joints.len(), joints.join(", "));
    Ok(ExitCode::SUCCESS)
}
