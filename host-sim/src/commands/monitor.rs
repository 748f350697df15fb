//! `bunraku monitor`: what a device says of itself.

use super::push::Port;
use anyhow::{Result, bail};
use firmware::link::message::{Hello, Request, ServoInfo, Telemetry};
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Show a device's telemetry: what it plays, its servos, its time, its faults.
///
/// Prints a line at each interval, and at each change of state and fault. Exits with 1 where the device no longer answers.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku monitor tcp:127.0.0.1:4100 --every 100 --csv > dance.csv")]
pub struct Args {
    #[command(flatten)]
    port: Port,
    /// Time in ms from one line to the next.
    #[arg(long, value_name = "MS", default_value_t = 500, value_parser = clap::value_parser!(u16).range(1..))]
    every: u16,
    /// End after so many seconds.
    #[arg(long, value_name = "SECONDS", value_parser = super::number::seconds)]
    seconds: Option<f64>,
    /// An object a line, with all servos.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Comma-separated values, with all servos.
    #[arg(long)]
    csv: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let mut client = args.port.open()?;
    let hello = client.hello().clone();
    client.request_done(&Request::Telemetry { millis: args.every })?;
    let start = Instant::now();
    let silence = Duration::from_millis(u64::from(args.every)) + Duration::from_secs(3);
    let mut out = std::io::stdout().lock();
    let mut headed = false;
    loop {
        let left =
            args.seconds.map(|seconds| Duration::from_secs_f64(seconds).saturating_sub(start.elapsed()));
        if left == Some(Duration::ZERO) {
            client.request_done(&Request::Telemetry { millis: 0 })?;
            return Ok(ExitCode::SUCCESS);
        }
        let limit = left.map_or(silence, |left| left.min(silence));
        let Some(telemetry) = client.telemetry(limit)? else {
            if limit < silence {
                continue;
            }
            bail!("{} says nothing any more", client.name());
        };
        if args.json {
            writeln!(out, "{}", value(&telemetry, hello.clock_hz))?;
        } else if args.csv {
            if !std::mem::replace(&mut headed, true) {
                writeln!(out, "{}", header(&telemetry))?;
            }
            writeln!(out, "{}", row(&telemetry, &hello))?;
        } else {
            writeln!(out, "{}", line(&telemetry, hello.clock_hz))?;
        }
        out.flush()?;
    }
}

fn millis(cycles: u32, clock_hz: u32) -> f64 {
    f64::from(cycles) * 1e3 / f64::from(clock_hz.max(1))
}

/// A line for people.
pub fn line(telemetry: &Telemetry, clock_hz: u32) -> String {
    let Telemetry { state, playing, stream, servos, .. } = telemetry;
    let mut line = format!("{:9.3} s  {:9}", f64::from(telemetry.millis) / 1e3, format!("{state:?}"));
    if let Some(playing) = playing {
        let clip = if playing.clip == firmware::clips::LIVE {
            "stream".to_owned()
        } else {
            format!("clip {}", playing.clip)
        };
        line += &format!("  {clip} frame {} at {:.2}x", playing.frame, f64::from(telemetry.speed) / 256.0);
    }
    if let (Some(stream), Some(firmware::clips::LIVE)) = (stream, playing.map(|playing| playing.clip)) {
        let counters = stream.counters;
        line += &format!(
            " of {}, {} made up, {} lost, {} late",
            stream.progress.frames, counters.concealed, counters.lost, counters.late
        );
    }
    line += &format!(
        "  tick {:.2} ms, at most {:.2}; {} of {} late",
        millis(telemetry.busy, clock_hz),
        millis(telemetry.busiest, clock_hz),
        telemetry.missed,
        telemetry.ticks
    );
    let readings = || servos.iter().filter_map(|servo| servo.reading);
    if let Some(hottest) = readings().filter_map(|reading| reading.temperature).max() {
        line += &format!("  {hottest} °C");
    }
    if let Some(lowest) = readings().filter_map(|reading| reading.millivolts).min() {
        line += &format!("  {:.1} V", f64::from(lowest) / 1e3);
    }
    let off = servos.iter().filter_map(|servo| Some((servo.reading?.position - servo.goal).abs())).max();
    if let Some(off) = off {
        line += &format!("  {off} goal units off");
    }
    if let Some(error) = telemetry.bus {
        line += &format!("  BUS: {error}");
    }
    if let Some(fault) = telemetry.fault {
        line += &format!("  FAULT: {fault}");
    }
    line
}

/// The same as JSON, with all servos.
pub fn value(telemetry: &Telemetry, clock_hz: u32) -> Value {
    let Telemetry { state, playing, stream, link, servos, .. } = telemetry;
    json!({
        "seconds": f64::from(telemetry.millis) / 1e3,
        "state": state,
        "fault": telemetry.fault.map(|fault| fault.to_string()),
        "playing": playing,
        "speed": f64::from(telemetry.speed) / 256.0,
        "ticks": telemetry.ticks,
        "missed": telemetry.missed,
        "cycles": telemetry.busy,
        "tick_ms": millis(telemetry.busy, clock_hz),
        "longest_ms": millis(telemetry.busiest, clock_hz),
        "bus": telemetry.bus.map(|error| error.to_string()),
        "stream": stream,
        "link": link,
        "servos": servos,
    })
}

fn header(telemetry: &Telemetry) -> String {
    let mut names: Vec<String> = [
        "seconds",
        "state",
        "fault",
        "clip",
        "frame",
        "speed",
        "ticks",
        "missed",
        "tick_ms",
        "longest_ms",
        "made_up",
        "lost",
        "late",
    ]
    .map(str::to_owned)
    .to_vec();
    for ServoInfo { id, .. } in &telemetry.servos {
        let each = ["goal", "position", "celsius", "volts", "load", "errors"];
        names.extend(each.map(|name| format!("{name}_{id}")));
    }
    names.join(",")
}

fn row(telemetry: &Telemetry, hello: &Hello) -> String {
    let or_nothing = |value: Option<String>| value.unwrap_or_default();
    let playing = telemetry.playing;
    let counters = telemetry.stream.map(|stream| stream.counters).unwrap_or_default();
    let mut values = vec![
        format!("{:.3}", f64::from(telemetry.millis) / 1e3),
        format!("{:?}", telemetry.state),
        or_nothing(telemetry.fault.map(|fault| format!("\"{fault}\""))),
        or_nothing(playing.map(|playing| playing.clip.to_string())),
        or_nothing(playing.map(|playing| playing.frame.to_string())),
        format!("{:.3}", f64::from(telemetry.speed) / 256.0),
        telemetry.ticks.to_string(),
        telemetry.missed.to_string(),
        format!("{:.3}", millis(telemetry.busy, hello.clock_hz)),
        format!("{:.3}", millis(telemetry.busiest, hello.clock_hz)),
        counters.concealed.to_string(),
        counters.lost.to_string(),
        counters.late.to_string(),
    ];
    for ServoInfo { goal, reading, .. } in &telemetry.servos {
        values.push(goal.to_string());
        values.push(or_nothing(reading.map(|reading| reading.position.to_string())));
        values
            .push(or_nothing(reading.and_then(|reading| reading.temperature).map(|value| value.to_string())));
        let volts = reading.and_then(|reading| reading.millivolts);
        values.push(or_nothing(volts.map(|value| format!("{:.3}", f64::from(value) / 1e3))));
        values.push(or_nothing(reading.and_then(|reading| reading.load).map(|value| value.to_string())));
        values.push(or_nothing(reading.map(|reading| reading.hardware_error.to_string())));
    }
    values.join(",")
}
