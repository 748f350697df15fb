//! `bunraku puppet calibrate`.

use anyhow::{Context, Result, anyhow, bail};
use firmware::map::BusSpec;
use host_sim::ports::{self, SerialBus};
use host_sim::puppet::calibrate::{Measured, write_measured};
use host_sim::puppet::channels;
use puppet_file::{NamedServo, Puppet, Units};
use servo_wire::bus::{Reading, ServoBus};
use std::io::{BufRead, IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Measure where a puppet's joints are at zero and how far they go, moved by hand.
///
/// All torque goes off, so hold the puppet. For each joint: bring it to where its channel is 0 (the skeleton's rest
/// pose), press Enter, move it to both of its ends, press Enter. Then `zero` and `goal_range` of the puppet.toml are
/// written; all else in it stays. No servo is ever told to move.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku puppet calibrate my-puppet.toml --on /dev/ttyUSB0 --joint \"right elbow\""
)]
pub struct Args {
    /// The puppet; it is written.
    puppet: PathBuf,
    /// The serial port (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "PORT")]
    on: String,
    /// A joint to measure; all unless given. Repeat for several.
    #[arg(long, value_name = "NAME")]
    joint: Vec<String>,
    /// Report what was measured as JSON.
    #[arg(long)]
    json: bool,
}

/// How often a joint is looked at while it is moved.
const LOOK: Duration = Duration::from_millis(20);

/// Looks in a row that may fail.
const PATIENCE: u32 = 10;

pub fn run(args: Args) -> Result<ExitCode> {
    let puppet = Puppet::read(&args.puppet)?;
    let servos = puppet.servos()?;
    if let Some(unknown) = args.joint.iter().find(|name| !servos.iter().any(|servo| servo.name == **name)) {
        bail!("{}: there is no joint \"{unknown}\"", args.puppet.display());
    }
    let specs = puppet.buses()?;
    let mut buses = open(&args.on, &puppet.bus_names(), &specs)?;
    let wanted = |servo: &&NamedServo| args.joint.is_empty() || args.joint.contains(&servo.name);
    let chosen: Vec<&NamedServo> =
        servos.iter().filter(|servo| buses[servo.bus].is_some()).filter(wanted).collect();
    if chosen.is_empty() {
        bail!("{}: none of these joints has a servo that can be read", args.puppet.display());
    }
    // Goals of the ranges as they are, to say where they become wider.
    let before = puppet.map(puppet.channels()?);
    let lines = lines();
    say("All torque goes off: hold the puppet, and press Enter.");
    enter(&lines)?;
    for servo in servos.iter() {
        if let Some(bus) = &mut buses[servo.bus] {
            let off = ports::block_on(bus.set_torque(&[servo.id], 0, false));
            off.map_err(|error| anyhow!("servo {} (\"{}\"): {error}", servo.id, servo.name))?;
        }
    }
    let mut measured = Vec::new();
    for (index, servo) in chosen.iter().enumerate() {
        let Some(bus) = &mut buses[servo.bus] else { continue };
        let number = format!("{}/{}", index + 1, chosen.len());
        say(&format!(
            "{number} {} (servo {}): to its zero, where the channel is 0. Enter; or s, to leave it as it is.",
            servo.name, servo.id
        ));
        if enter(&lines)?.trim() == "s" {
            continue;
        }
        let zero = look(bus, servo)?.position;
        say(&format!("     its zero is {zero}. Now to both of its ends. Enter."));
        let (min, max) = ends(bus, servo, &lines)?;
        let Units { lowest, highest, .. } = Units::of(specs[servo.bus].kind, servo.model);
        if min < lowest || max > highest {
            say(&format!(
                "     {min} to {max} is not within {lowest} to {highest}: mount its horn turned, and measure again. Left \
                 as it is."
            ));
            continue;
        }
        say(&format!("     {min} to {max}."));
        let map = before.as_ref().ok();
        let joint = map.and_then(|map| map.joints().iter().find(|joint| puppet.name_of(joint) == servo.name));
        if let Some(joint) = joint.filter(|joint| min < joint.min || max > joint.max) {
            let (old_min, old_max) = (joint.min, joint.max);
            say(&format!(
                "     That is wider than the range that the file has, {old_min} to {old_max}. To keep a limit of yours, \
                 measure again and stop there."
            ));
        }
        measured.push(Measured { name: servo.name.clone(), zero, min, max });
    }
    if !measured.is_empty() {
        write_measured(&puppet, &measured)?;
    }
    if args.json {
        let joints: Vec<_> = measured
            .iter()
            .map(|joint| serde_json::json!({ "name": joint.name, "zero": joint.zero, "goal_range": [joint.min, joint.max] }))
            .collect();
        println!("{:#}", serde_json::json!({ "measured": joints }));
    } else {
        println!("{}: {} of {} joints measured", args.puppet.display(), measured.len(), chosen.len());
    }
    // A home that is no longer within its range, for instance.
    let after = Puppet::read(&args.puppet)?;
    if let Err(mistakes) = after.check(channels::of_clips(&after, None)?) {
        mistakes.iter().for_each(|mistake| eprintln!("bunraku: {mistake:#}"));
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// The buses whose servos can be read, in the puppet's order.
fn open(on: &str, names: &[String], specs: &[BusSpec]) -> Result<Vec<Option<SerialBus>>> {
    let reads = |index: &usize| specs[*index].kind.reads();
    let readable: Vec<usize> = (0..specs.len()).filter(reads).collect();
    let paths = ports::paths(on, names, |index| reads(&index))?;
    let mut buses: Vec<Option<SerialBus>> = specs.iter().map(|_| None).collect();
    for (index, path) in readable.into_iter().zip(paths) {
        buses[index] = Some(SerialBus::open(specs[index], &path)?);
    }
    Ok(buses)
}

/// Where a joint is, which does not hold.
fn look(bus: &mut SerialBus, servo: &NamedServo) -> Result<Reading> {
    let mut tried = 0;
    loop {
        match ports::block_on(bus.look(servo.id)) {
            Ok(Reading { torque: Some(true), .. }) => {
                bail!("servo {} (\"{}\") holds: somebody has turned its torque on", servo.id, servo.name)
            }
            Ok(reading) => return Ok(reading),
            Err(_) if tried < PATIENCE => tried += 1,
            Err(error) => return Err(anyhow!("servo {} (\"{}\"): {error}", servo.id, servo.name)),
        }
    }
}

/// The lowest and the highest position until somebody presses Enter.
fn ends(bus: &mut SerialBus, servo: &NamedServo, lines: &Receiver<String>) -> Result<(i32, i32)> {
    let first = look(bus, servo)?.position;
    let (mut min, mut max) = (first, first);
    let live = std::io::stderr().is_terminal();
    loop {
        let position = look(bus, servo)?.position;
        (min, max) = (min.min(position), max.max(position));
        if live {
            eprint!("\r     {position:5}  ({min} to {max})   ");
            std::io::stderr().flush().context("cannot write to the terminal")?;
        }
        match lines.recv_timeout(LOOK) {
            Ok(_) => return Ok((min, max)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => bail!("the input ended before all joints were measured"),
        }
    }
}

fn say(what: &str) {
    eprintln!("{what}");
}

/// What is typed, line by line.
fn lines() -> Receiver<String> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Ok(line) = line else { return };
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

fn enter(lines: &Receiver<String>) -> Result<String> {
    lines.recv().map_err(|_| anyhow!("the input ended before all joints were measured"))
}
