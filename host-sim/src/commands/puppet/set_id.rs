//! `bunraku puppet set-id`.

use super::scan::kind;
use anyhow::{Result, anyhow, bail};
use firmware::map::{BusKind, BusSpec};
use host_sim::ports::{self, Identity, SerialBus};
use puppet_file::models;
use servo_wire::bus::BusError;
use std::process::ExitCode;

/// Give a servo another id, which it keeps without power.
///
/// Servos come from the factory with the id 1, so connect them one by one. Nothing is written where more than one servo answers to
/// the old id, or any to the new one. The servo lets go, and does not move.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku puppet set-id --on /dev/ttyUSB0 --from 1 --to 5 --baud 57600\n  \
    bunraku puppet set-id --on /dev/ttyACM0 --kind sts --from 1 --to 5"
)]
pub struct Args {
    /// The serial port.
    #[arg(long, value_name = "PORT")]
    on: String,
    /// The id that the servo has.
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u8).range(0..=252))]
    from: u8,
    /// The id that it is to have.
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u8).range(0..=252))]
    to: u8,
    /// What the servo speaks: dynamixel, dynamixel1, sts or scs.
    #[arg(long, value_parser = kind, default_value = "dynamixel")]
    kind: BusKind,
    /// Its bits per second.
    #[arg(long, value_name = "BAUD", default_value_t = 1_000_000)]
    baud: u32,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// How often is asked whether a servo is alone: two may talk at once in a way that looks like one.
const LOOKS: usize = 5;

pub fn run(args: Args) -> Result<ExitCode> {
    let Args { from, to, .. } = args;
    if from == to {
        bail!("--from and --to are both {from}");
    }
    let spec = BusSpec { kind: args.kind, baud: args.baud };
    let mut bus = SerialBus::open(spec, &args.on)?;
    let place = format!("on {} at {} baud", args.on, args.baud);
    for _ in 0..LOOKS {
        match ports::block_on(bus.count_answers(from)) {
            Ok(1) => {}
            Ok(_) | Err(BusError::Corrupt) => bail!(
                "more than one servo answers to the id {from} {place}: connect only the one that is to have the id {to}"
            ),
            Err(BusError::NoReply) => bail!(
                "no servo of the kind {} answers to the id {from} {place}: `bunraku puppet scan` finds those that are there",
                spec.kind.name()
            ),
            Err(error) => bail!("{error} {place}"),
        }
    }
    match ports::block_on(bus.count_answers(to)) {
        Err(BusError::NoReply) => {}
        Ok(_) | Err(BusError::Corrupt) => bail!("the id {to} is taken {place}: nothing was written"),
        Err(error) => bail!("{error} {place}"),
    }
    let before = identity(&mut bus, from).map_err(|error| anyhow!("servo {from}: {error}"))?;
    ports::block_on(bus.set_id(from, to))
        .map_err(|error| anyhow!("servo {from} does not take another id: {error}"))?;
    let after = identity(&mut bus, to);
    let left = ports::block_on(bus.count_answers(from));
    let name = models::name(before.model);
    match (after, left) {
        (Ok(after), Err(BusError::NoReply)) if after == before => {}
        (Err(_), Ok(_)) => bail!("the {name} {place} still has the id {from}: it did not take {to}"),
        (after, left) => bail!(
            "the {name} {place} was given the id {to}, and now {} answers to {to} and {} to {from}: scan the port",
            if after.is_ok() { "a servo" } else { "none" },
            if left.is_ok() { "one" } else { "none" }
        ),
    }
    if args.json {
        println!(
            "{:#}",
            serde_json::json!({ "model": before.model, "model_name": name, "from": from, "to": to })
        );
    } else {
        println!("the {name} that had the id {from} has the id {to}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Who a servo is; an answer may be lost.
fn identity(bus: &mut SerialBus, id: u8) -> Result<Identity, BusError> {
    let mut found = Err(BusError::NoReply);
    for _ in 0..ports::TRIES {
        found = ports::block_on(bus.identify(id));
        if found.is_ok() {
            break;
        }
    }
    found
}
