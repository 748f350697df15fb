//! `bunraku puppet check`.

use super::on_port::OnPort;
use crate::commands::joints::{Table, tidy};
use anyhow::{Context, Result};
use firmware::limits::FINE_BITS;
use firmware::map::Joint;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::puppet::budget::{BusTime, bus_times};
use host_sim::puppet::channels;
use host_sim::puppet::rehearse::{Demand, rehearse};
use puppet_file::{Channels, Map, Puppet, Unit};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Check a puppet.toml: every mistake with its line, then its joints, and what a tick costs on its buses.
///
/// With a clip also the range that each joint moves in, and where the clip leaves a joint's range, or is faster or more sudden
/// than the joint may be; the player then does what the joint can. With a port also what the servos there are set to and should not be:
/// operating mode, position limits, torque limit, profile and more. Exits with 1 where there is a mistake, a tick does not fit on a
/// bus, or a servo is missing or set wrong.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku puppet check puppets/cmu-20.toml --skeleton 02.asf --clip walk.mclip\n  \
    bunraku puppet check my-puppet.toml --on /dev/ttyUSB0\n  bunraku puppet check my-puppet.toml --on /dev/ttyUSB0 --fix"
)]
pub struct Args {
    /// The puppet.
    puppet: PathBuf,
    /// The skeleton whose channels it follows (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// A clip to hold against the joints' limits (.qmd, .mclip).
    #[arg(long, value_name = "CLIP")]
    clip: Option<PathBuf>,
    /// Microseconds that servos wait before they answer: 0 as it should be set, 500 as from the factory.
    #[arg(long, value_name = "US", default_value_t = 0.0, value_parser = crate::commands::number::microseconds)]
    return_delay: f64,
    /// Read what the servos on this serial port are set to (NAME=PORT,NAME=PORT for a puppet with several buses).
    #[arg(long, value_name = "PORT")]
    on: Option<String>,
    /// Set right what is set wrong, and read it back.
    #[arg(long, requires = "on")]
    fix: bool,
    /// Let servos go that hold, where something is set that is kept without power: a puppet that they hold up falls.
    #[arg(long, requires = "fix")]
    torque_off: bool,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    joints: Vec<JointReport<'a>>,
    servo_hz: u16,
    buses: Vec<BusTime>,
    tick_micros: f64,
    micros_on_buses: f64,
    /// `None` where nothing goes over a wire.
    highest_hz: Option<u32>,
    fits: bool,
    /// What the player makes of the clip.
    in_clip: Option<Table>,
    /// What the servos on a port are set to.
    servos: Option<OnPort>,
}

#[derive(Serialize)]
struct JointReport<'a> {
    name: &'a str,
    channel: &'a str,
    unit: &'static str,
    bus: String,
    id: u8,
    goal_range: [i32; 2],
    zero: i32,
    home: i32,
    range: [f64; 2],
    max_speed: f64,
    max_acceleration: f64,
    demand: Option<Demand>,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let (puppet, mut mistakes) = Puppet::read_all(&args.puppet);
    let Some(puppet) = puppet else { return Ok(tell(&mistakes, &[], args.json)) };
    let bytes = args.clip.as_deref().map(files::read).transpose()?;
    let clip = match (&args.clip, &bytes) {
        (Some(path), Some(bytes)) => Some((path, Clip::headers(path, bytes)?)),
        _ => None,
    };
    let channels = match &clip {
        Some((path, clip)) => channels::of_played(path, clip, &puppet, args.skeleton),
        None => channels::of_clips(&puppet, args.skeleton),
    };
    // Without its skeleton or with another clip a puppet may have mistakes of its own.
    let (channels, elsewhere) = match channels {
        Ok(channels) => (channels, None),
        Err(error) => (puppet.right_channels(), Some(error)),
    };
    let map = match puppet.check(channels.clone()) {
        Ok(map) if mistakes.is_empty() && elsewhere.is_none() => map,
        checked => {
            mistakes.extend(checked.err().into_iter().flatten());
            return Ok(tell(
                &mistakes,
                &elsewhere.map(|error| format!("{error:#}")).into_iter().collect::<Vec<_>>(),
                args.json,
            ));
        }
    };
    let demands = match &clip {
        None => None,
        Some((path, clip)) => {
            clip.check(path, false)?;
            let demands = clip.decode(|frames| rehearse(frames, &map));
            Some(demands.with_context(|| format!("cannot play {}", path.display()))?)
        }
    };
    let in_clip = clip
        .as_ref()
        .map(|(path, clip)| Table::of_clip(path, clip, clip.rate_centihertz(), &puppet, &map, &channels));
    let in_clip = in_clip.transpose()?;
    let servos = match &args.on {
        Some(on) => Some(OnPort::look(on, &puppet, &map, args.fix, args.torque_off)?),
        None => None,
    };
    let report = Report { in_clip, servos, ..report(&puppet, &map, &channels, args.return_delay, demands) };
    if args.json {
        println!("{:#}", serde_json::to_value(&report)?);
    } else {
        print(&report, &args.clip);
        report.servos.iter().for_each(OnPort::print);
    }
    let good = report.fits && report.servos.as_ref().is_none_or(OnPort::is_good);
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Says what is wrong: of the puppet line by line, and then what else.
fn tell(mistakes: &[puppet_file::Error], elsewhere: &[String], json: bool) -> ExitCode {
    let mut sorted: Vec<&puppet_file::Error> = mistakes.iter().collect();
    sorted.sort_by_key(|mistake| mistake.place().map_or(usize::MAX, |place| place.line));
    let mut sentences: Vec<String> = sorted.iter().map(|mistake| format!("{mistake:#}")).collect();
    sentences.extend_from_slice(elsewhere);
    let mut said = std::collections::BTreeSet::new();
    sentences.retain(|sentence| said.insert(sentence.clone()));
    if json {
        println!("{:#}", serde_json::json!({ "mistakes": sentences }));
    } else {
        sentences.iter().for_each(|mistake| eprintln!("bunraku: {mistake}"));
    }
    ExitCode::FAILURE
}

fn report<'a>(
    puppet: &'a Puppet,
    map: &Map,
    channels: &'a Channels,
    return_delay_us: f64,
    demands: Option<Vec<Demand>>,
) -> Report<'a> {
    let names = puppet.bus_names();
    let hz = f64::from(map.tick_hz());
    let joint = |(index, joint): (usize, &Joint)| {
        let channel = channels.name(joint.channel.into());
        let unit = channels.find(channel).map_or(Unit::Centimetre, |(_, unit)| unit);
        let scale = joint.scale.to_num::<f64>();
        let value = |goal: i32| f64::from(goal - joint.zero) / scale;
        let (one, other) = (value(joint.min), value(joint.max));
        let per_second = |fine: i32| f64::from(fine) / f64::from(1 << FINE_BITS) / scale.abs() * hz;
        JointReport {
            name: puppet.name_of(joint),
            channel,
            unit: unit.symbol(),
            bus: names.get(usize::from(joint.bus)).cloned().unwrap_or_default(),
            id: joint.id,
            goal_range: [joint.min, joint.max],
            zero: joint.zero,
            home: joint.home,
            range: [one.min(other), one.max(other)].map(tidy),
            max_speed: per_second(joint.max_velocity),
            max_acceleration: per_second(joint.max_acceleration) * hz,
            demand: demands.as_ref().and_then(|demands| demands.get(index).cloned()),
        }
    };
    let joints = map.joints().iter().enumerate().map(joint).collect();
    let buses = bus_times(puppet, map, return_delay_us);
    // A tick serves one bus after the other.
    let micros: f64 = buses.iter().map(|bus| bus.micros).sum();
    let tick_micros = 1e6 / hz;
    Report {
        joints,
        servo_hz: map.tick_hz(),
        tick_micros,
        micros_on_buses: micros,
        highest_hz: (micros > 0.0).then(|| (1e6 / micros) as u32),
        fits: micros <= tick_micros,
        buses,
        in_clip: None,
        servos: None,
    }
}

fn print(report: &Report<'_>, clip: &Option<PathBuf>) {
    let Report { joints, buses, .. } = report;
    let width = joints.iter().map(|joint| joint.name.chars().count()).max().unwrap_or(0).max(5);
    let channels = joints.iter().map(|joint| joint.channel.chars().count()).max().unwrap_or(0).max(7);
    println!(
        "{:width$}  {:>5}  {:channels$}  {:>19}  {:>13}  {:>5}  {:>9}  {:>13}",
        "joint", "servo", "channel", "range", "goals", "home", "speed", "acceleration"
    );
    for joint in joints {
        let servo =
            if buses.len() > 1 { format!("{}/{}", joint.bus, joint.id) } else { joint.id.to_string() };
        let ([low, high], unit) = (joint.range, joint.unit);
        let [min, max] = joint.goal_range;
        println!(
            "{:width$}  {servo:>5}  {:channels$}  {low:7.1} to {high:6.1} {unit}  {min:>5} to {max:>4}  {:>5}  {:5.0} {unit}/s  {:7.0} {unit}/s²",
            joint.name, joint.channel, joint.home, joint.max_speed, joint.max_acceleration
        );
    }
    println!();
    for bus in buses {
        let BusTime { name, baud, servos, goal_bytes, question_bytes, answer_bytes, .. } = bus;
        let kind = bus.kind.name();
        if bus.micros == 0.0 {
            println!("{name} ({kind}): {servos} servos, {baud} pulses a second");
            continue;
        }
        println!(
            "{name} ({kind}): {servos} servos at {baud} baud; a tick is {} bytes ({goal_bytes} goals, {question_bytes} \
             questions, {answer_bytes} answers), {:.0} µs",
            goal_bytes + question_bytes + answer_bytes,
            bus.micros
        );
    }
    println!(
        "{} Hz: the buses take {:.0} of {:.0} µs{}{}",
        report.servo_hz,
        report.micros_on_buses,
        report.tick_micros,
        report.highest_hz.map_or(String::new(), |hz| format!("; they bear {hz} Hz at most")),
        if report.fits { "" } else { ": too much" }
    );
    if let (Some(path), Some(table)) = (clip, &report.in_clip) {
        println!("\n{}:", path.display());
        table.print();
        print_demands(joints, width);
    }
}

fn print_demands(joints: &[JointReport<'_>], width: usize) {
    let unmet = || joints.iter().filter_map(|joint| Some((joint, joint.demand.as_ref()?)));
    let count = unmet().filter(|(_, demand)| !demand.is_met()).count();
    println!("{} of {} joints can do all that the clip asks of them", joints.len() - count, joints.len());
    for (joint, demand) in unmet().filter(|(_, demand)| !demand.is_met()) {
        let unit = joint.unit;
        let mut said = Vec::new();
        if let Some((first, ticks)) = demand.out_of_range {
            let beyond = demand.beyond_range;
            said.push(format!(
                "out of range from {first:.2} s on in {ticks} ticks, by {:.1} {unit} at {:.2} s",
                beyond.value, beyond.seconds
            ));
        }
        if demand.too_fast > 0 {
            let speed = demand.speed;
            said.push(format!(
                "too fast in {} ticks, {:.0} {unit}/s at {:.2} s",
                demand.too_fast, speed.value, speed.seconds
            ));
        }
        if demand.too_sudden > 0 {
            let sudden = demand.acceleration;
            said.push(format!(
                "too sudden in {} ticks, {:.0} {unit}/s² at {:.2} s",
                demand.too_sudden, sudden.value, sudden.seconds
            ));
        }
        println!(
            "{:width$}  {}; limits keep it {:.1} {unit} away at {:.2} s",
            joint.name,
            said.join("; "),
            demand.off.value,
            demand.off.seconds
        );
    }
}
