//! `bunraku show`: a whole show with everything that can happen, on one page.

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use host_sim::files;
use host_sim::show::{self, PlayedShow, Program, Summary};
use std::path::PathBuf;
use std::process::ExitCode;

/// Run a show to its end on virtual servos, and report what happened.
///
/// A show is clips with crossfades, commands, and servos that restart, fall silent or are cut off.
///
/// The firmware runs in this program, on the simulated Cortex-M4 (which counts what each tick costs) or under QEMU; all three tell
/// the servos the same. Exits with 1 where a goal was outside limits, or a fault is latched in the end.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku show puppets/show.toml --on sim --html show.html\n\nWhat a show.toml says is in \
    puppets/show.toml."
)]
pub struct Args {
    /// The show.
    show: PathBuf,
    /// Where the firmware runs.
    #[arg(long, value_enum, default_value_t = On::Host)]
    on: On,
    /// Write a page with plots: goals and positions, errors, speeds, deadlines, states and faults.
    #[arg(long, value_name = "PAGE.html")]
    html: Option<PathBuf>,
    /// Write every goal: time in seconds, bus, servo, position.
    #[arg(long, value_name = "OUT.csv")]
    log: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum On {
    /// In this program.
    Host,
    /// On the simulated Cortex-M4, which counts cycles.
    Sim,
    /// On QEMU's mps2-an386, a Cortex-M4.
    Qemu,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let program = Program::read(&args.show)?;
    if program.clips.is_empty() {
        bail!("{} has no [[clip]]", args.show.display());
    }
    let log = &mut |line: &str| eprintln!("{line}");
    let (on, played) = match args.on {
        On::Host => ("host", show::on_host(&program)),
        On::Sim => ("sim", show::on_sim(&program, log)),
        On::Qemu => ("qemu", show::on_qemu(&program, log)),
    };
    let played = played.with_context(|| format!("cannot play {}", args.show.display()))?;
    let summary = Summary::new(&program, &played, on);
    if let Some(path) = &args.html {
        let page = show::show_page(&program, &played, &summary);
        files::write(path, |file| Ok(file.write_all(page.as_bytes())?))?;
    }
    if let Some(path) = &args.log {
        super::play::write_log(path, &played.recording, &program.buses)?;
    }
    if args.json {
        let notes = serde_json::to_value(&played.notes)?;
        println!("{:#}", serde_json::json!({ "summary": summary, "notes": notes }));
    } else {
        print(&program, &played, &summary);
    }
    let good = summary.outside_limits == 0 && summary.fault.is_none();
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn print(program: &Program, played: &PlayedShow, summary: &Summary) {
    println!(
        "{}: {} ticks at {} Hz on {} servos, {:.2} s; ends {}",
        summary.name,
        summary.ticks,
        program.map.tick_hz(),
        program.joints.len(),
        summary.seconds,
        summary.ends
    );
    println!(
        "  {} of {} goals outside limits; servos refused {} instructions",
        summary.outside_limits, summary.goals, summary.refused
    );
    for fault in &summary.faults {
        let settled = fault
            .settled_ms
            .map_or("and never settled".to_owned(), |ms| format!("{} after {ms:.0} ms", fault.state));
        let acknowledged =
            fault.acknowledged_at.map_or(String::new(), |at| format!(", acknowledged at {at:.2} s"));
        println!("  {:.2} s: {}; {settled}{acknowledged}", fault.at, fault.fault);
    }
    for stream in &summary.streams {
        println!(
            "  {:.2} to {:.2} s live: {} frames as sent, {} concealed, {} on the way back, {} passed over",
            stream.from, stream.to, stream.played, stream.concealed, stream.eased, stream.lost
        );
    }
    if let Some(servo) = summary.servos.iter().max_by(|one, other| one.error_rms.total_cmp(&other.error_rms))
    {
        println!(
            "  the servo furthest from its goals is {} (\"{}\"): {:.2}° rms, {:.2}° at {:.2} s",
            servo.id, servo.name, servo.error_rms, servo.error_max, servo.error_max_at
        );
    }
    if let Some(cost) = &summary.cost {
        println!(
            "  {:.0} cycles awake a tick, {} at most; {:.2} ms on the bus at most, {:.2} ms left in the median, {:.2} at \
             least; {} of {} ticks overrun",
            cost.awake_mean,
            cost.awake_max,
            cost.bus_us_max / 1e3,
            cost.left_us_median / 1e3,
            cost.left_us_min / 1e3,
            cost.overrun,
            played.costs.len()
        );
    }
    for row in &summary.overruns {
        println!(
            "  {:.2} s: {} ticks overrun while {}: {:.2} ms on the bus at most, {} cycles awake",
            row.at,
            row.ticks,
            row.state,
            row.bus_us_max / 1e3,
            row.awake_max
        );
    }
    for note in played.notes.iter().filter(|note| note.what == show::NoteKind::Refused) {
        println!("  tick {}: the puppet did not take {}", note.tick, note.text);
    }
}
