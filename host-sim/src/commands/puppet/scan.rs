//! `bunraku puppet scan`.

use super::on_port::{self, Setting};
use anyhow::{Result, anyhow, bail};
use firmware::map::{BusKind, BusSpec};
use host_sim::ports::{self, Identity, SerialBus};
use host_sim::settings::{self, Expected, Judged, Mismatch};
use puppet_file::{NamedServo, Puppet, models};
use serde::Serialize;
use servo_wire::bus::{
    BusError, ERROR_ALERT, ERROR_ENCODER, ERROR_HEAT, ERROR_OVERLOAD, ERROR_SHOCK, ERROR_VOLTAGE, Reading,
};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;

/// Find the servos on a serial port: model, id, firmware, position, temperature, supply and errors of each, how often each
/// answered, and what it is set to that makes movements wrong.
///
/// Writes nothing to any servo. With a puppet it also says which of its servos are missing, which have another model,
/// and which there are too many. It exits with 1 where something is not as it should be.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bunraku puppet scan --on /dev/ttyUSB0 --puppet puppets/cmu-12.toml\n  \
    bunraku puppet scan --on /dev/ttyUSB0 --baud 57600,1000000,3000000\n  \
    bunraku puppet scan --on /dev/ttyACM0 --kind sts --ids 1-20")]
pub struct Args {
    /// The serial port (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "PORT")]
    on: String,
    /// The puppet whose servos should be there.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: Option<PathBuf>,
    /// What the servos speak: dynamixel, dynamixel1, sts or scs; the puppet's unless given.
    #[arg(long, conflicts_with = "puppet", value_parser = kind)]
    kind: Option<BusKind>,
    /// Rates to try, separated by commas; the puppet's unless given, else 57600 and 1000000.
    #[arg(long, value_name = "B,B", value_delimiter = ',')]
    baud: Vec<u32>,
    /// Ids to ask one by one; 0 to 253 unless given, or, of Dynamixel 2.0, all at once and those of the puppet.
    #[arg(long, value_name = "A-B")]
    ids: Option<Ids>,
    /// List the registers that decide how each servo moves, with their values.
    #[arg(long)]
    settings: bool,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// How often each servo that is there is asked: on a bad line it does not answer each time.
const ASKS: usize = 5;

/// How often the whole bus is asked who is there.
const ROUNDS: usize = 2;

#[derive(Clone)]
struct Ids(RangeInclusive<u8>);

impl FromStr for Ids {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        match (first.parse(), last.parse()) {
            (Ok(first), Ok(last)) if first <= last && last <= 253 => Ok(Self(first..=last)),
            _ => Err("expected an id or a range of ids up to 253, for instance 1-20".to_owned()),
        }
    }
}

/// Parses what servos that can be read speak.
pub fn kind(text: &str) -> Result<BusKind, String> {
    let kinds = [BusKind::Dynamixel, BusKind::Dynamixel1, BusKind::Sts, BusKind::Scs];
    let names = kinds.map(BusKind::name).join(", ");
    BusKind::from_name(text)
        .filter(|kind| kinds.contains(kind))
        .ok_or_else(|| format!("expected one of {names}"))
}

/// A bus to look at.
struct Wanted {
    spec: BusSpec,
    path: String,
    bauds: Vec<u32>,
    servos: Vec<NamedServo>,
    expected: Vec<Expected>,
}

/// Somebody who answered.
struct Who {
    id: u8,
    /// Who it says it is; `None` of one that answers pings alone.
    identity: Option<Identity>,
    /// How many of [`ASKS`] questions it answered.
    answered: usize,
}

#[derive(Serialize)]
struct Found {
    port: String,
    kind: &'static str,
    baud: u32,
    id: u8,
    joint: Option<String>,
    model: Option<u16>,
    model_name: String,
    firmware: Option<u16>,
    answered: usize,
    asked: usize,
    position: Option<i32>,
    celsius: Option<u8>,
    volts: Option<f64>,
    torque: Option<bool>,
    errors: Vec<&'static str>,
    mismatches: Vec<Mismatch>,
    settings: Vec<Setting>,
    /// A sentence for each mismatch.
    #[serde(skip)]
    sentences: Vec<String>,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let (mut found, mut amiss) = (Vec::new(), Vec::new());
    for wanted in wanted(&args)? {
        let mut here: Vec<Found> = Vec::new();
        for &baud in &wanted.bauds {
            let spec = BusSpec { baud, ..wanted.spec };
            let mut bus = SerialBus::open(spec, &wanted.path)?;
            for who in who(&mut bus, &wanted, args.ids.as_ref())? {
                here.push(look(&mut bus, &wanted, baud, &who)?);
            }
        }
        if args.puppet.is_some() {
            compare(&wanted, &here, &mut amiss);
        }
        for servo in &here {
            amiss.extend_from_slice(&servo.sentences);
            if servo.answered < servo.asked {
                amiss.push(format!(
                    "servo {} on {} answered {} of {} times: the line is bad, or two servos have this id",
                    servo.id, servo.port, servo.answered, servo.asked
                ));
            }
        }
        found.extend(here);
    }
    if args.json {
        println!("{:#}", serde_json::json!({ "servos": found, "amiss": amiss }));
    } else {
        print(&found);
        if args.settings {
            found.iter().for_each(print_settings);
        }
        amiss.iter().for_each(|sentence| println!("{sentence}"));
        if let (Some(puppet), true) = (&args.puppet, found.iter().any(|servo| !servo.sentences.is_empty())) {
            println!("to set these right: bunraku puppet check {} --on {} --fix", puppet.display(), args.on);
        }
    }
    let good = amiss.is_empty() && !found.is_empty();
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn wanted(args: &Args) -> Result<Vec<Wanted>> {
    let Some(path) = &args.puppet else {
        let bauds = if args.baud.is_empty() { vec![57_600, 1_000_000] } else { args.baud.clone() };
        let spec = BusSpec { kind: args.kind.unwrap_or(BusKind::Dynamixel), baud: bauds[0] };
        let (servos, expected) = (Vec::new(), Vec::new());
        return Ok(vec![Wanted { spec, path: args.on.clone(), bauds, servos, expected }]);
    };
    let puppet = Puppet::read(path)?;
    let (specs, servos) = (puppet.buses()?, puppet.servos()?);
    // A puppet with mistakes has servos too.
    let map = puppet.channels().and_then(|channels| puppet.map(channels)).ok();
    let expected = settings::expected(&puppet, map.as_ref())?;
    let readable: Vec<usize> = (0..specs.len()).filter(|&index| specs[index].kind.reads()).collect();
    if readable.is_empty() {
        bail!("{} has no bus whose servos can be read", path.display());
    }
    let paths = ports::paths(&args.on, &puppet.bus_names(), |index| specs[index].kind.reads())?;
    let wanted = readable.into_iter().zip(paths).map(|(index, path)| Wanted {
        spec: specs[index],
        path,
        bauds: if args.baud.is_empty() { vec![specs[index].baud] } else { args.baud.clone() },
        servos: servos.iter().filter(|servo| servo.bus == index).cloned().collect(),
        expected: expected.get(index).cloned().unwrap_or_default(),
    });
    Ok(wanted.collect())
}

/// Who answers, by id, and how often: all are asked in [`ROUNDS`], those of the puppet and those who are there in [`ASKS`].
fn who(bus: &mut SerialBus, wanted: &Wanted, ids: Option<&Ids>) -> Result<Vec<Who>> {
    let failed = |error: BusError| anyhow!("{}: {error}", wanted.path);
    let mut found: Vec<Who> = Vec::new();
    let of_puppet: Vec<u8> = wanted.servos.iter().map(|servo| servo.id).collect();
    let asked: Vec<u8> = match ids {
        Some(Ids(ids)) => ids.clone().collect(),
        None if wanted.spec.kind == BusKind::Dynamixel => {
            for _ in 0..ROUNDS {
                for (id, identity) in ports::block_on(bus.identify_all()).map_err(failed)? {
                    if !found.iter().any(|who| who.id == id) {
                        found.push(Who { id, identity: Some(identity), answered: 0 });
                    }
                }
            }
            // Where two answer at once, neither is heard.
            of_puppet.clone()
        }
        None => (0..=253).collect(),
    };
    for round in 0..ASKS {
        for &id in &asked {
            let again = round < ROUNDS || of_puppet.contains(&id);
            if !again || found.iter().any(|who| who.id == id) {
                continue;
            }
            // Whoever answers no reads still answers a ping.
            let pinged = round + 1 == ROUNDS;
            if pinged && !ports::block_on(bus.is_there(id)) {
                continue;
            }
            match ports::block_on(bus.identify(id)) {
                Ok(identity) => found.push(Who { id, identity: Some(identity), answered: 0 }),
                Err(BusError::Port) => return Err(failed(BusError::Port)),
                Err(_) if pinged => found.push(Who { id, identity: None, answered: 0 }),
                Err(_) => {}
            }
        }
    }
    for who in &mut found {
        for _ in 0..ASKS {
            let answered = match who.identity {
                Some(identity) => ports::block_on(bus.identify(who.id)) == Ok(identity),
                None => ports::block_on(bus.is_there(who.id)),
            };
            who.answered += usize::from(answered);
        }
    }
    found.sort_by_key(|who| who.id);
    Ok(found)
}

fn look(bus: &mut SerialBus, wanted: &Wanted, baud: u32, who: &Who) -> Result<Found> {
    let &Who { id, identity, answered } = who;
    // One that said who it is also says where it is, though an answer may be lost.
    let reading = (0..ASKS).find_map(|_| ports::block_on(bus.look(id)).ok());
    let unknown = || Expected { id, ..Expected::default() };
    let expected = wanted.expected.iter().find(|expected| expected.id == id).cloned().unwrap_or_else(unknown);
    let joint = Some(expected.name.clone()).filter(|name| !name.is_empty());
    let survey = settings::survey(bus, wanted.spec.kind, &expected);
    let survey = ports::block_on(survey).map_err(|error| anyhow!("{}: {error}", wanted.path))?;
    Ok(Found {
        port: wanted.path.clone(),
        kind: wanted.spec.kind.name(),
        baud,
        id,
        joint,
        model: identity.map(|identity| identity.model),
        model_name: identity.map_or_else(|| "unknown".to_owned(), |identity| models::name(identity.model)),
        firmware: identity.map(|identity| identity.firmware),
        answered,
        asked: ASKS,
        position: reading.map(|reading| reading.position),
        celsius: reading.and_then(|reading| reading.temperature),
        volts: reading.and_then(|reading| reading.millivolts).map(|millivolts| f64::from(millivolts) / 1e3),
        torque: reading.and_then(|reading| reading.torque),
        errors: reading.as_ref().map(errors).unwrap_or_default(),
        sentences: survey.sentences(Judged::Warned).collect(),
        settings: survey.settings.as_ref().map(on_port::list).unwrap_or_default(),
        mismatches: survey.mismatches,
    })
}

fn errors(reading: &Reading) -> Vec<&'static str> {
    let names = [
        (ERROR_VOLTAGE, "supply"),
        (ERROR_HEAT, "heat"),
        (ERROR_ENCODER, "encoder"),
        (ERROR_SHOCK, "shock"),
        (ERROR_OVERLOAD, "overload"),
        (ERROR_ALERT, "alert"),
    ];
    names.into_iter().filter(|(bit, _)| reading.hardware_error & bit != 0).map(|(_, name)| name).collect()
}

/// What is not as the puppet says.
fn compare(wanted: &Wanted, found: &[Found], amiss: &mut Vec<String>) {
    for servo in &wanted.servos {
        let named = format!("servo {} (\"{}\") on {}", servo.id, servo.name, wanted.path);
        let Some(there) = found.iter().find(|there| there.id == servo.id) else {
            amiss.push(format!("{named} does not answer"));
            continue;
        };
        if there.baud != wanted.spec.baud {
            amiss.push(format!("{named} answers at {} baud, expected {}", there.baud, wanted.spec.baud));
        }
    }
    for there in found.iter().filter(|there| there.joint.is_none()) {
        let who = format!("a {} with the id {} is on {}", there.model_name, there.id, wanted.path);
        amiss.push(format!("{who}, and no joint has that id"));
    }
}

fn print(found: &[Found]) {
    if found.is_empty() {
        println!("no servo answers");
        return;
    }
    let width = found.iter().filter_map(|servo| servo.joint.as_ref()).map(|name| name.chars().count()).max();
    let width = width.unwrap_or(1).max(5);
    println!(
        " id  {:width$}  {:14}  {:>8}  {:>7}  {:>8}  {:>8}  {:>6}  {:>6}  {:6}  errors",
        "joint", "model", "firmware", "answers", "baud", "position", "temp", "supply", "torque"
    );
    for servo in found {
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        println!(
            "{:>3}  {:width$}  {:14}  {:>8}  {:>7}  {:>8}  {:>8}  {:>6}  {:>6}  {:6}  {}",
            servo.id,
            servo.joint.as_deref().unwrap_or("-"),
            servo.model_name,
            or_dash(servo.firmware.map(|firmware| firmware.to_string())),
            format!("{} of {}", servo.answered, servo.asked),
            servo.baud,
            or_dash(servo.position.map(|position| position.to_string())),
            or_dash(servo.celsius.map(|celsius| format!("{celsius} °C"))),
            or_dash(servo.volts.map(|volts| format!("{volts:.1} V"))),
            or_dash(servo.torque.map(|on| if on { "on" } else { "off" }.to_owned())),
            if servo.errors.is_empty() { "none".to_owned() } else { servo.errors.join(", ") },
        );
    }
}

/// The registers of one servo.
fn print_settings(servo: &Found) {
    println!("servo {}:", servo.id);
    for Setting { register, address, value } in &servo.settings {
        let amiss = servo.mismatches.iter().find(|mismatch| mismatch.address == Some(*address));
        let expected = amiss.map_or(String::new(), |amiss| format!("  expected {}", amiss.expected));
        println!("  {address:>3}  {register:24}  {value:>6}{expected}");
    }
}
