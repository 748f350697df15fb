//! `bunraku bench`: our decoder beside others.

use super::input;
use anyhow::{Context, Result};
use clap::Subcommand;
use host_sim::files;
use host_sim::peers::{self, Comparison, Entry, Method, PACKERS};
use indicatif::{ProgressBar, ProgressStyle};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use thumb_cycles::Core;

/// Compare our codecs with other ways to store motion.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku bench peers")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Peers(PeersArgs),
}

/// Compare our codecs with int16 frames, as they are and packed by general compressors.
///
/// The same motion is stored in every way, linked into a player, and played on a simulated Cortex-M0+ and Cortex-M4.
/// Without a motion it takes the embedded sample.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  bunraku bench peers 02_01.amc --skeleton 02.asf --plot peers.svg")]
struct PeersArgs {
    /// The recording: .bvh, .amc, .glb, .csv or .json.
    input: Option<PathBuf>,
    #[command(flatten)]
    source: input::Source,
    /// Draw bytes against cycles.
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// Cores that are compared on.
const CORES: [Core; 2] = [Core::M0Plus, Core::M4];

pub fn run(args: Args) -> Result<ExitCode> {
    match args.what {
        What::Peers(args) => peers(args),
    }
}

fn peers(args: PeersArgs) -> Result<ExitCode> {
    let (name, clip) = match &args.input {
        Some(path) => (path.display().to_string(), args.source.load(path)?),
        None => ("embedded sample".to_owned(), mocap::sample::clip()),
    };
    let (frames, channels) = (clip.motion.frames(), clip.motion.channels);
    let left_out: Vec<&str> = PACKERS.into_iter().filter_map(|packer| packer.left_out()).collect();
    let methods = Method::all(channels);
    let bar = ProgressBar::new(methods.len() as u64);
    bar.set_style(ProgressStyle::with_template("{spinner} {wide_bar} {pos} of {len}, {msg}")?);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar.set_message("building the players");
    let comparison = Comparison::new(&clip, &CORES).with_context(|| name.clone())?;
    let mut entries = Vec::new();
    for method in methods {
        bar.set_message(method.name());
        entries.push(comparison.measure(method).with_context(|| name.clone())?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(path) = &args.plot {
        let title = args.input.as_deref().and_then(Path::file_name).unwrap_or(OsStr::new(&name));
        let title = format!("{}: {frames} frames of {channels} channels", title.display());
        let svg = peers::plot(&title, &entries)?;
        files::write(path, |file| Ok(file.write_all(svg.as_bytes())?))?;
    }
    if args.json {
        let report = serde_json::json!({
            "motion": name, "frames": frames, "channels": channels, "entries": entries, "left_out": left_out,
        });
        println!("{report:#}");
    } else {
        print(&name, frames, channels, &entries);
        left_out.iter().for_each(|why| println!("{why}."));
    }
    Ok(ExitCode::SUCCESS)
}

fn print(name: &str, frames: usize, channels: usize, entries: &[Entry]) {
    println!(
        "{name}: {frames} frames of {channels} channels; float32 takes {} bytes\n",
        frames * channels * 4
    );
    print!("                                 mean error");
    CORES.iter().for_each(|core| print!(" | {:<38}", core.name()));
    println!();
    print!("method                     bytes  cm a joint");
    CORES.iter().for_each(|_| print!(" | cycles: mean     worst    RAM   flash "));
    println!();
    for entry in entries {
        print!("{:<23} {:>8} {:>11.5}", entry.name, entry.bytes, entry.mean_joint_cm);
        for cost in &entry.costs {
            print!(
                " | {:>12.0} {:>9} {:>6} {:>7} ",
                cost.cycles_mean, cost.cycles_max, cost.ram_bytes, cost.flash_bytes
            );
        }
        println!();
    }
    println!(
        "\nint16: 0.01° a step, blocks of up to {} bytes unpacked at once. RAM is static and stack; flash is the\n\
         decoder's, without the motion.",
        peers::BLOCK_BYTES
    );
    CORES.iter().for_each(|core| println!("{}", core.evidence()));
}
