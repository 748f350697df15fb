//! `bunraku optimize`: the best FDF, b and n_d for a motion.

use super::input;
use anyhow::{Context, Result, bail};
use encoder::qmd::Method;
use encoder::qmd::optimize::{Outcome, Problem, Space};
use encoder::source::Source;
use host_sim::files;
use indicatif::{ProgressBar, ProgressStyle};
use mocap::metrics::Evaluator;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Find the QMD parameters FDF, b and n_d with the least bytes × error (QMD 5.3).
///
/// The pruned search gives the optimum of the exhaustive one wherever an error no more than doubles as FDF grows
/// (with --faithful: grows sixfold); --exhaustive encodes them all. Without --max-bytes a clip may be as large as the motion in
/// float32, and then nearly all channels become floats: say what you can spend.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku optimize 02_01.amc --skeleton 02.asf --max-bytes 40000 -o walk.qmd"
)]
pub struct Args {
    /// The recording: .bvh, .amc, .glb, .csv or .json.
    input: PathBuf,
    #[command(flatten)]
    source: input::Source,
    /// Encode with all parameters instead of pruning.
    #[arg(long)]
    exhaustive: bool,
    /// Largest clip of use; the motion's size in float32 unless given.
    #[arg(long, value_name = "BYTES")]
    max_bytes: Option<usize>,
    /// Largest FDF to try; all channels unless given.
    #[arg(long, value_name = "CHANNELS")]
    max_fdf: Option<u16>,
    /// Largest b to try.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u8).range(8..=16))]
    max_bits: u8,
    /// n_d is tried in multiples of this.
    #[arg(long, value_name = "FRAMES", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..))]
    step: u32,
    /// Search with the paper's encoder instead of ours.
    #[arg(long)]
    faithful: bool,
    /// Where the best clip goes.
    #[arg(short, long, value_name = "OUT.qmd")]
    output: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    if let Some(output) = args.output.as_deref().filter(|output| !input::is_qmd(output)) {
        bail!("{}: expected .qmd at the end of the name", output.display());
    }
    let clip = args.source.load(&args.input)?;
    let cannot = || format!("cannot encode {}", args.input.display());
    let source = Source::new(&clip.skeleton, &clip.motion).with_context(cannot)?;
    let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).with_context(cannot)?;
    let method = if args.faithful { Method::FAITHFUL } else { Method::ClosedLoop };
    let problem = Problem::new(&source, &evaluator, method);
    let (frames, channels) = (source.frames(), source.channels());
    let space = Space::new(
        frames,
        channels,
        args.max_fdf.unwrap_or(u16::MAX),
        args.max_bits,
        args.step,
        args.max_bytes.unwrap_or_else(|| Space::float32_bytes(frames, channels)),
    );
    let cells = space.len();
    let bar = ProgressBar::new(cells as u64);
    bar.set_style(ProgressStyle::with_template("{wide_bar} {pos} of {len} encodes, {eta} left")?);
    bar.enable_steady_tick(Duration::from_millis(200));
    let progress = |done: usize| bar.set_position(done as u64);
    let outcome = if args.exhaustive {
        problem.exhaustive(&space, &progress)
    } else {
        problem.pruned(&space, &progress)
    };
    bar.finish_and_clear();
    let Some(Outcome { best, encodes }) = outcome.with_context(cannot)? else {
        bail!("no parameters give a clip of at most {} bytes", space.max_bytes);
    };
    if let Some(output) = &args.output {
        let bytes = source.encode(best.parameters, method).with_context(cannot)?;
        files::write(output, |file| Ok(file.write_all(&bytes)?))?;
    }
    if args.json {
        let report = serde_json::json!({ "best": best, "encodes": encodes, "exhaustive_encodes": cells });
        println!("{report:#}");
    } else {
        let parameters = best.parameters;
        println!(
            "FDF {}, b {}, n_d {}",
            parameters.fixed_channels, parameters.index_bits, parameters.segment_frames
        );
        println!(
            "  {} bytes, mean joint error {:.6} cm, merit {:.4}",
            best.bytes, best.mean_joint_cm, best.merit
        );
        println!("  {encodes} encodes, an exhaustive search takes {cells}");
    }
    Ok(ExitCode::SUCCESS)
}
