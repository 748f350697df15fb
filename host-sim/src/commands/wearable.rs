//! `bunraku wearable`: how long a core is awake that only decodes.

use super::play;
use anyhow::{Context, Result, bail};
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::profile::parts::Part;
use host_sim::profile::wearable::measure_wearable;
use std::path::PathBuf;
use std::process::ExitCode;

/// Measure how long an nRF52840 is awake that plays a clip on outputs without a bus, and what it draws (docs/POWER.md).
///
/// Builds a whole image, which sleeps between ticks and puts a level out for every joint of the puppet, and runs it on the
/// simulated Cortex-M4 at 64 MHz. Counted is all that the core does: waking, the timer's interrupt, decoding, storing the levels.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku wearable walk.qmd --puppet puppets/cmu-20.toml --skeleton 02.asf --most 0.2"
)]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: PathBuf,
    /// The puppet: its joints are the outputs.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// The skeleton whose channels the clip has (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// How often a second the outputs change.
    #[arg(long, value_name = "F", default_value_t = 30)]
    fps: u16,
    /// Wait states of the flash; the nRF52840 has none where its cache has the code.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=15))]
    wait_states: u32,
    /// Most percent of the time that it may be awake.
    #[arg(long, value_name = "PERCENT", value_parser = super::number::percent)]
    most: Option<f64>,
    /// The battery.
    #[arg(long, value_name = "MAH", default_value_t = 1000.0, value_parser = super::number::above_zero)]
    battery: f64,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = files::read(&args.clip)?;
    let name = args.clip.display();
    let clip = Clip::parse(&args.clip, &bytes)?;
    if clip.rate_centihertz() == 0 {
        bail!("{name} does not say its frame rate, which a wearable plays at");
    }
    let map = play::map(&args.clip, &clip, &args.puppet, args.skeleton)?;
    let Some(part) = Part::named("nrf52840") else { bail!("no part is called nrf52840") };
    let cost = measure_wearable(&clip, &bytes, &map, args.fps, part.clock_hz as u32, args.wait_states)
        .with_context(|| format!("cannot wear {name}"))?;
    let (share, mean, worst) = (cost.share(), cost.mean(), cost.worst());
    let energy = part.energy(mean, f64::from(args.fps), args.battery);
    if args.json {
        let report = serde_json::json!({
            "outputs": map.joints().len(), "fps": args.fps, "ticks": cost.awake.len(), "wait_states": args.wait_states,
            "awake": share, "cycles_mean": mean, "cycles_max": worst, "flash_bytes": cost.flash_bytes,
            "ram_bytes": cost.ram_bytes, "stack_bytes": cost.stack_bytes, "energy": energy,
        });
        println!("{report:#}");
    } else {
        println!(
            "{name}: {} ticks of {} outputs at {} Hz, {} channels at {} Hz, {} wait states",
            cost.awake.len(),
            map.joints().len(),
            args.fps,
            clip.channels(),
            f64::from(clip.rate_centihertz()) / 100.0,
            args.wait_states
        );
        println!(
            "  awake {:.3} % of the time at {} MHz: {mean:.0} cycles a tick, {worst} at most",
            share * 100.0,
            part.clock_hz / 1e6
        );
        println!(
            "  {} bytes of flash with the clip, {} of RAM, {} of stack",
            cost.flash_bytes, cost.ram_bytes, cost.stack_bytes
        );
        println!(
            "{} at {} V, {} mA running, {} mA asleep:\n  {:.3} µJ a tick, {:.1} µA on average, {:.0} hours from {} mAh, core and RAM only",
            energy.part,
            energy.volts,
            energy.run_ma,
            energy.sleep_ma,
            energy.microjoules_per_frame,
            energy.mean_microamps,
            energy.battery_hours,
            energy.battery_mah
        );
        println!("  {}", energy.source);
    }
    match args.most {
        Some(most) if share * 100.0 > most => {
            eprintln!("bunraku: awake {:.3} % of the time, expected at most {most} %", share * 100.0);
            Ok(ExitCode::FAILURE)
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}
