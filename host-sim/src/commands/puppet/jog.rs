//! `bunraku puppet jog`.

use crate::commands::joints::tidy;
use anyhow::{Context, Result, anyhow, bail, ensure};
use decoder_core::I16F16;
use firmware::limits::Limiter;
use firmware::map::{BusKind, Joint};
use host_sim::ports::{self, SerialBus};
use host_sim::settings::{self, Expected, Judged};
use puppet_file::{Map, Puppet};
use servo_wire::bus::{BusError, Goal, Reading, ServoBus};
use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

/// Move one joint of a puppet, within its range and its speed, and say where it comes to.
///
/// With a joint and degrees it moves once. Without them, it reads them line by line: the joint's name, then degrees; an empty line
/// ends it. Degrees are those of the joint's channel, as `range` in the puppet.toml has them. A joint goes from where it is; the others
/// are told nothing. It is held where it came to.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku puppet jog my-puppet.toml --on /dev/ttyUSB0 \"right elbow\" -30\n  \
    bunraku puppet jog my-puppet.toml --on /dev/ttyUSB0"
)]
pub struct Args {
    /// The puppet.
    puppet: PathBuf,
    /// The serial port (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "PORT")]
    on: String,
    /// The joint to move.
    #[arg(requires = "degrees")]
    joint: Option<String>,
    /// Where to, in degrees of its channel.
    #[arg(allow_negative_numbers = true, value_parser = crate::commands::number::angle)]
    degrees: Option<f64>,
    /// Let the joints that were moved go in the end.
    #[arg(long)]
    torque_off: bool,
    /// Report each move as JSON, a line each.
    #[arg(long)]
    json: bool,
}

/// Time that a servo gets to come to where it was sent, after it was told so.
const SETTLE: Duration = Duration::from_millis(500);

/// A joint that can be moved.
struct Jogged<'p> {
    name: &'p str,
    model: Option<u16>,
    joint: &'p Joint,
}

impl Jogged<'_> {
    /// A goal in degrees of the channel.
    fn degrees(&self, goal: i32) -> f64 {
        tidy(f64::from(goal - self.joint.zero) / self.joint.scale.to_num::<f64>())
    }

    /// Its range in degrees of the channel.
    fn range(&self) -> (f64, f64) {
        let (one, other) = (self.degrees(self.joint.min), self.degrees(self.joint.max));
        (one.min(other), one.max(other))
    }
}

pub fn run(args: Args) -> Result<ExitCode> {
    let puppet = Puppet::read(&args.puppet)?;
    let map = puppet.map(puppet.channels()?)?;
    let servos = puppet.servos()?;
    let jogged = |joint| {
        let name = puppet.name_of(joint);
        let model = servos.iter().find(|servo| servo.name == name).and_then(|servo| servo.model);
        Jogged { name, model, joint }
    };
    let joints: Vec<Jogged<'_>> = map.joints().iter().map(jogged).collect();
    let mut buses = Buses { on: &args.on, names: puppet.bus_names(), map: &map, open: Vec::new() };
    let mut moved = Vec::new();
    if let (Some(name), Some(degrees)) = (&args.joint, args.degrees) {
        let jogged = find(&joints, name)?;
        let came = jog(&mut buses, jogged, degrees, &mut moved)?;
        say(jogged, degrees, came, args.json);
    } else {
        let width = joints.iter().map(|jogged| jogged.name.chars().count()).max().unwrap_or(0);
        for jogged in &joints {
            let (low, high) = jogged.range();
            eprintln!("{:width$}  servo {:3}  {low:7.1} to {high:.1}", jogged.name, jogged.joint.id);
        }
        eprintln!("A joint and degrees, for instance: {} 0. An empty line ends.", joints[0].name);
        for line in std::io::stdin().lock().lines() {
            let line = line.context("cannot read standard input")?;
            if line.trim().is_empty() {
                break;
            }
            // What is mistyped ends nothing.
            let parsed = parse(&line).and_then(|(name, degrees)| Ok((find(&joints, name)?, degrees)));
            let done = parsed.and_then(|(jogged, degrees)| {
                let came = jog(&mut buses, jogged, degrees, &mut moved)?;
                say(jogged, degrees, came, args.json);
                Ok(())
            });
            if let Err(error) = done {
                eprintln!("{error:#}");
            }
        }
    }
    if args.torque_off {
        for &(bus, id) in &moved {
            let off = ports::block_on(buses.get(bus)?.set_torque(&[id], 0, false));
            off.map_err(|error| anyhow!("servo {id} may still hold: {error}"))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// A joint's name and degrees.
fn parse(line: &str) -> Result<(&str, f64)> {
    let (name, degrees) =
        line.trim().rsplit_once(char::is_whitespace).context("expected a joint and degrees")?;
    let degrees =
        degrees.parse().map_err(|_| anyhow!("found \"{degrees}\", expected degrees behind the joint"))?;
    Ok((name.trim(), degrees))
}

fn find<'j, 'p>(joints: &'j [Jogged<'p>], name: &str) -> Result<&'j Jogged<'p>> {
    joints.iter().find(|jogged| jogged.name == name).with_context(|| {
        let names: Vec<&str> = joints.iter().map(|jogged| jogged.name).collect();
        format!("the puppet has no joint \"{name}\", expected one of: {}", names.join(", "))
    })
}

/// The buses that were needed so far.
struct Buses<'a> {
    on: &'a str,
    names: Vec<String>,
    map: &'a Map,
    open: Vec<(usize, SerialBus)>,
}

impl Buses<'_> {
    fn get(&mut self, bus: usize) -> Result<&mut SerialBus> {
        let place = match self.open.iter().position(|(index, _)| *index == bus) {
            Some(place) => place,
            None => {
                let paths = ports::paths(self.on, &self.names, |index| index == bus)?;
                let (spec, path) = (self.map.buses().get(bus), paths.first());
                let (spec, path) = spec.zip(path).context("the puppet has no such bus")?;
                self.open.push((bus, SerialBus::open(*spec, path)?));
                self.open.len() - 1
            }
        };
        Ok(&mut self.open[place].1)
    }
}

/// Moves a joint, and gives where its servo then is, if it can say that.
fn jog(
    buses: &mut Buses<'_>,
    jogged: &Jogged<'_>,
    degrees: f64,
    moved: &mut Vec<(usize, u8)>,
) -> Result<Option<i32>> {
    let (joint, (low, high)) = (jogged.joint, jogged.range());
    // Ranges are whole goals.
    let unit = 0.5 / joint.scale.to_num::<f64>().abs();
    ensure!(
        (low - unit..=high + unit).contains(&degrees),
        "{} goes from {low:.1} to {high:.1} degrees, found {degrees}",
        jogged.name
    );
    let limits = joint.limits();
    let wanted = joint.goal(I16F16::saturating_from_num(degrees)).max(limits.min()).min(limits.max());
    let tick = Duration::from_secs(1) / u32::from(buses.map.tick_hz());
    let (bus, ids) = (usize::from(joint.bus), [joint.id]);
    let kind = &buses.map.buses().get(bus).context("the puppet has no such bus")?.kind;
    let line = buses.get(bus)?;
    let failed = |error: BusError| anyhow!("servo {} (\"{}\"): {error}", joint.id, jogged.name);
    ports::block_on(line.ping(&ids, 0)).map_err(failed)?;
    refuse_wrong_settings(line, jogged, *kind)?;
    let start = match read(line, joint) {
        Ok(reading) => {
            ensure!(
                (joint.min..=joint.max).contains(&reading.position),
                "{} is at {:.1} degrees, outside its range of {low:.1} to {high:.1}: bring it there by hand",
                jogged.name,
                jogged.degrees(reading.position)
            );
            reading.position
        }
        // Hobby servos say nothing, and are told to be where they should be at rest.
        Err(BusError::Unsupported) => joint.home,
        Err(error) => return Err(failed(error)),
    };
    let mut limiter = Limiter::at(start);
    ports::block_on(line.set_torque(&ids, 0, true)).map_err(failed)?;
    if !moved.contains(&(bus, joint.id)) {
        moved.push((bus, joint.id));
    }
    let mut due = Instant::now();
    loop {
        limiter.follow(&limits, wanted);
        let goal = Goal { id: joint.id, position: limiter.goal() };
        ports::block_on(line.write_goals(&[goal])).map_err(failed)?;
        if limiter.position() == wanted && limiter.velocity() == 0 {
            break;
        }
        due += tick;
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    let end = Instant::now() + SETTLE;
    loop {
        match read(line, joint) {
            Ok(reading) if reading.position == limiter.goal() || Instant::now() > end => {
                return Ok(Some(reading.position));
            }
            Ok(_) => thread::sleep(tick),
            Err(BusError::Unsupported) => return Ok(None),
            Err(error) => return Err(failed(error)),
        }
    }
}

/// Whether the servo goes where it is told.
///
/// # Errors
/// A sentence for each setting that makes it go elsewhere.
fn refuse_wrong_settings(line: &mut SerialBus, jogged: &Jogged<'_>, kind: BusKind) -> Result<()> {
    if !kind.reads() {
        return Ok(());
    }
    let (id, joint) = (jogged.joint.id, Some(*jogged.joint));
    let expected =
        Expected { id, joint, name: jogged.name.to_owned(), model: jogged.model, ..Expected::default() };
    let found = ports::block_on(settings::survey(line, kind, &expected));
    let refused: Vec<String> = found.iter().flat_map(|found| found.sentences(Judged::Refused)).collect();
    if refused.is_empty() {
        return Ok(());
    }
    bail!("{}; `bunraku puppet check --fix` sets it right", refused.join("; "))
}

/// Reads a servo; an answer may be lost.
fn read(bus: &mut SerialBus, joint: &Joint) -> Result<Reading, BusError> {
    if !bus.reads(0) {
        return Err(BusError::Unsupported);
    }
    let mut found = Err(BusError::NoReply);
    for _ in 0..ports::TRIES {
        found = ports::block_on(bus.look(joint.id));
        if found.is_ok() {
            break;
        }
    }
    found
}

fn say(jogged: &Jogged<'_>, wanted: f64, came: Option<i32>, json: bool) {
    let there = came.map(|position| jogged.degrees(position));
    if json {
        let report = serde_json::json!({
            "joint": jogged.name, "servo": jogged.joint.id, "wanted": wanted, "position": came, "degrees": there,
        });
        println!("{report}");
    } else if let (Some(position), Some(there)) = (came, there) {
        println!(
            "{}: sent to {wanted:.1}, is at {there:.1} degrees (servo {}, position {position})",
            jogged.name, jogged.joint.id
        );
    } else {
        println!(
            "{}: sent to {wanted:.1} degrees; servo {} cannot say where it is",
            jogged.name, jogged.joint.id
        );
    }
    // Whoever reads line by line is not kept waiting.
    let _ = std::io::stdout().flush();
}
