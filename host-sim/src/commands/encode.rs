//! `bunraku encode`: motion capture in, a compressed clip out.

use super::codec;
use super::fit_table;
use super::input::{self, Quality, is_mclip, is_qmd};
use super::joints;
use super::number::above_zero;
use anyhow::{Context, Result};
use decoder_core::mclip::{CodecId, EntropyId};
use encoder::codec::encode::OptionError;
use encoder::mclip::{Bounds, Encoder, Encoding, Target};
use encoder::qmd::{self, Parameters};
use host_sim::cycle_limit::{self, Goal, Limit};
use host_sim::files;
use host_sim::puppet::joint_errors::{Asked, JointBounds, Recorded};
use indicatif::ProgressBar;
use mocap::Clip;
use mocap::metrics::Evaluator;
use puppet_file::Puppet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Encode a recording (BVH, AMC with its ASF, GLB, CSV or JSON) into a clip.
///
/// A .qmd has the byte layout of the QMD paper. A .mclip holds any codec in blocks with checksums, and takes what it
/// should come to: bits of a code, bounds of its errors, or a rate; a mean joint error of 0.1 cm unless given. The clip is the
/// smallest of all that were tried within the bounds; where none is, the nearest, and a line says what it has.
///
/// With --puppet the bounds are those of the puppet's joints, and the errors are those of what the servos are told: the clip on the
/// puppet's ticks, within the joints' limits, in whole goals. A joint whose limits alone are beyond the bounds is told, and its clip
/// is held to them.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku encode 02_01.amc --skeleton 02.asf --codec qmd -o walk.qmd\n  bunraku encode 02_01.amc --skeleton 02.asf --codec dpcm --target-error 0.1 -o walk.mclip\n  bunraku encode 02_01.amc --skeleton 02.asf --target-error 0.1 --max-cycles 12000@cortex-m0plus -o walk.mclip"
)]
pub struct Args {
    /// The recording: .bvh, .amc, .glb, .csv or .json.
    input: PathBuf,
    #[command(flatten)]
    source: input::Source,
    /// The codec; qmd for a .qmd and dpcm for a .mclip unless given.
    #[arg(long, value_parser = codec::codec())]
    codec: Option<CodecId>,
    /// Bits of a code: 8 to 16 for a .qmd (QMD b, 8 unless given), 1 to 16 for a .mclip.
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u8).range(1..=16))]
    bits: Option<u8>,
    /// Largest mean joint error, over all joints and frames and over those that move alone (.mclip).
    #[arg(long, value_name = "CM", value_parser = above_zero, conflicts_with = "bits")]
    target_error: Option<f64>,
    /// Largest error of any point 3 cm off a bone in any frame (.mclip); 10 times the target error unless given.
    #[arg(long, value_name = "CM", value_parser = above_zero, conflicts_with_all = ["bits", "target_rate"])]
    worst_error: Option<f64>,
    /// Largest error of each joint of the puppet, root of the mean square, in degrees (cm of a joint that slides) (.mclip); 0.25
    /// unless given.
    #[arg(long, value_name = "DEGREES", value_parser = above_zero, requires = "puppet",
        conflicts_with_all = ["bits", "target_error", "worst_error", "target_rate", "max_cycles"])]
    target_degrees: Option<f64>,
    /// Largest error of each joint of the puppet at any time (.mclip); 2 unless given.
    #[arg(long, value_name = "DEGREES", value_parser = above_zero, requires = "puppet",
        conflicts_with_all = ["bits", "target_error", "worst_error", "target_rate", "max_cycles"])]
    worst_degrees: Option<f64>,
    /// Bits per second to stay within (.mclip).
    #[arg(long, value_name = "BITS_PER_S", value_parser = above_zero, conflicts_with_all = ["bits", "target_error"])]
    target_rate: Option<f64>,
    /// Most cycles that any frame may take: tries the codecs and entropy stages that are not given, counts the cycles of
    /// each on a simulated core (cortex-m4 unless named), and keeps the best clip that is within (.mclip).
    #[arg(long, value_name = "N[@CORE]")]
    max_cycles: Option<Limit>,
    /// The entropy stage (.mclip); the smallest unless given.
    #[arg(long, value_parser = codec::entropy())]
    entropy: Option<EntropyId>,
    #[command(flatten)]
    options: codec::Options,
    /// Frames from one entry point to the next (.mclip); 480 unless given.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..))]
    entry: Option<u32>,
    /// Longest block in bytes (.mclip): what a receiver has to hold; 1024 unless given.
    #[arg(long, value_name = "BYTES")]
    block: Option<u16>,
    #[command(flatten)]
    quality: Quality,
    /// Frames of a segment, each with a table of its own (QMD n_d); the whole clip unless given.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..))]
    segment: Option<u32>,
    /// Where the clip goes; its extension says the container.
    #[arg(short, long, value_name = "OUT.qmd|.mclip")]
    output: PathBuf,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let in_blocks = is_mclip(&args.output);
    let codec = args.codec.unwrap_or(if in_blocks { CodecId::Dpcm } else { CodecId::Qmd });
    let (name, output) = (codec.name(), args.output.display());
    if !in_blocks && !is_qmd(&args.output) {
        usage(&format!("{output}: the name does not say the container, expected .mclip or .qmd at its end"));
    }
    if !in_blocks && codec != CodecId::Qmd {
        usage(&format!("{output}: codec {name} needs a .mclip, for instance -o out.mclip"));
    }
    if !in_blocks && let Some(option) = only_in_blocks(&args).next() {
        usage(&format!("{output}: --{option} needs a .mclip, for instance -o out.mclip"));
    }
    if !in_blocks && (args.target_error.is_some() || args.worst_error.is_some() || args.target_rate.is_some())
    {
        usage(&format!("{output}: a target needs a .mclip; for a .qmd there is bunraku optimize"));
    }
    let encoding = encoding(&args, codec).unwrap_or_else(|error| usage(&error.to_string()));
    let (low, high) = if in_blocks { (1, encoding.most_bits()) } else { (8, 16) };
    if let Some(bits) = args.bits.filter(|bits| !(low..=high).contains(bits)) {
        usage(&format!("{output}: --bits is {bits}, expected {low} to {high}"));
    }
    let (clip, fitted) = args.source.load_fitted(&args.input)?;
    if let Some(report) = &fitted {
        eprintln!("{}", fit_table::table(report).trim_end());
    }
    let puppet = args.source.puppet.as_deref().map(Puppet::read).transpose()?;
    let in_degrees = in_blocks
        && args.bits.is_none()
        && args.target_error.is_none()
        && args.worst_error.is_none()
        && args.target_rate.is_none()
        && args.max_cycles.is_none();
    let bytes = match &puppet {
        Some(puppet) if in_degrees => by_joints(&args, &encoding, &clip, puppet).map(|bytes| (bytes, codec)),
        _ if in_blocks => mclip(&args, &encoding, &clip),
        _ => qmd(&args, &clip).map(|bytes| (bytes, codec)),
    };
    let (bytes, codec) = bytes.with_context(|| format!("cannot encode {}", args.input.display()))?;
    let joints =
        puppet.as_ref().map(|puppet| joints::Table::of_recording(&args.output, &bytes, puppet, &clip));
    let joints = joints.transpose()?;
    files::write(&args.output, |file| Ok(file.write_all(&bytes)?))?;
    let (frames, channels) = (clip.motion.frames(), clip.motion.channels);
    let ratio = (frames * channels * 4) as f64 / bytes.len() as f64;
    let rate = bytes.len() as f64 * 8.0 * clip.motion.fps / frames as f64;
    if args.json {
        let report = serde_json::json!({
            "output": args.output, "frames": frames, "channels": channels, "fps": clip.motion.fps,
            "bytes": bytes.len(), "ratio_f32": ratio, "bits_per_s": rate, "codec": codec.name(), "joints": joints,
            "fit": fitted,
        });
        println!("{report:#}");
    } else {
        println!(
            "{}: {frames} frames of {channels} channels at {} fps in {} bytes, {ratio:.2} times smaller than float32, {rate:.0} bits/s",
            args.output.display(),
            input::short(clip.motion.fps),
            bytes.len(),
        );
        joints.iter().for_each(joints::Table::print);
    }
    if let (Some(joints), true) = (joints, in_degrees) {
        joints.tell_beyond(&args.output, joint_bounds(&args));
    }
    Ok(ExitCode::SUCCESS)
}

fn qmd(args: &Args, clip: &Clip) -> Result<Vec<u8>> {
    let parameters = Parameters {
        index_bits: args.bits.unwrap_or(Parameters::TABLE_1.index_bits),
        fixed_channels: args.quality.fixed_channels(clip.motion.channels),
        segment_frames: args.segment.unwrap_or(u32::MAX),
    };
    Ok(qmd::encode(clip, parameters, args.quality.method())?)
}

fn encoding(args: &Args, codec: CodecId) -> Result<Encoding, OptionError> {
    let (entropy, entry_frames) = (args.entropy, args.entry.unwrap_or(480) as usize);
    let block_bytes = args.block.unwrap_or(1024);
    Ok(Encoding { codec: args.options.settings(codec)?, entropy, entry_frames, block_bytes })
}

/// Options that were given and mean nothing for a .qmd.
fn only_in_blocks(args: &Args) -> impl Iterator<Item = &'static str> {
    let named = [
        ("max-cycles", args.max_cycles.is_some()),
        ("entropy", args.entropy.is_some()),
        ("entry", args.entry.is_some()),
        ("block", args.block.is_some()),
    ];
    named.into_iter().filter(|(_, given)| *given).map(|(name, _)| name).chain(args.options.given())
}

/// Ends the command with what was wrong about its arguments.
fn usage(message: &str) -> ! {
    <Args as clap::Args>::augment_args(clap::Command::new("bunraku encode"))
        .error(clap::error::ErrorKind::ValueValidation, message)
        .exit()
}

/// The clip, and its codec.
fn mclip(args: &Args, encoding: &Encoding, clip: &Clip) -> Result<(Vec<u8>, CodecId)> {
    let codec = encoding.codec.id();
    let encoder = Encoder::new(&clip.skeleton, &clip.motion)?;
    let evaluator = Evaluator::new(&clip.skeleton, &clip.motion)?;
    let target = match args.target_rate {
        Some(rate) => Target::Rate(rate),
        None => Target::Within(bounds(args)),
    };
    if let Some(limit) = args.max_cycles {
        let goal = args.bits.map_or(Goal::Target(target), Goal::Bits);
        return best_within(args, encoding, &encoder, &evaluator, goal, limit);
    }
    if let Some(bits) = args.bits {
        return Ok((encoder.encode(encoding, encoder::mclip::Quality::Bits(bits))?, codec));
    }
    let encoded = encoder.encode_to(encoding, target, &evaluator)?;
    let (name, rate) = (args.output.display(), encoder.rate(&encoded.bytes));
    match target {
        Target::Within(bounds) if bounds.excess(&encoded.errors) > 1.0 => {
            eprintln!(
                "bunraku: {name}: the nearest to the bounds that was found has a mean joint error of {:.4} cm, expected {} cm at \
                 most, and {:.4} cm at worst, expected {} cm",
                encoded.errors.mean_cm(),
                bounds.mean_cm,
                encoded.errors.max_point_cm,
                bounds.worst_cm
            );
        }
        Target::Rate(limit) if rate > limit => {
            eprintln!(
                "bunraku: {name}: the lowest rate that this codec has is {rate:.0} bits/s, above {limit}"
            );
        }
        _ => {}
    }
    Ok((encoded.bytes, codec))
}

/// The smallest clip whose joints are within their bounds on the puppet.
fn by_joints(args: &Args, encoding: &Encoding, clip: &Clip, puppet: &Puppet) -> Result<Vec<u8>> {
    let map = puppet.map(&clip.skeleton)?;
    let mut motion = clip.motion.clone();
    motion.unwrap_angles(&clip.skeleton);
    let bounds = joint_bounds(args);
    let asked = Asked::of(&mut Recorded::new(&motion), &map)?;
    let without_loss = asked.errors(&mut Recorded::new(&motion))?;
    let encoder = Encoder::new(&clip.skeleton, &clip.motion)?;
    encoder.encode_each(encoding, bounds.rms, |bytes| {
        let played =
            host_sim::clip::Clip::parse(&args.output, bytes)?.decode(|frames| asked.errors(frames))?;
        let mut excess = vec![0.0_f64; clip.motion.channels];
        for ((joint, error), least) in map.joints().iter().zip(&played).zip(&without_loss) {
            let channel = &mut excess[usize::from(joint.channel)];
            *channel = channel.max(bounds.excess_of_clip(error, least));
        }
        anyhow::Ok(excess)
    })
}

/// How large the errors of the puppet's joints may be.
fn joint_bounds(args: &Args) -> JointBounds {
    JointBounds { rms: args.target_degrees.unwrap_or(0.25), worst: args.worst_degrees.unwrap_or(2.0) }
}

/// How large the errors may be.
fn bounds(args: &Args) -> Bounds {
    let mean_cm = args.target_error.unwrap_or(0.1);
    Bounds { mean_cm, worst_cm: args.worst_error.unwrap_or(10.0 * mean_cm) }
}

/// The best clip whose most expensive frame is within a limit.
fn best_within(
    args: &Args,
    base: &Encoding,
    encoder: &Encoder<'_>,
    evaluator: &Evaluator,
    goal: Goal,
    limit: Limit,
) -> Result<(Vec<u8>, CodecId)> {
    let candidates = cycle_limit::candidates(base, args.codec, args.entropy);
    let spinner = ProgressBar::new_spinner();
    spinner.enable_steady_tick(Duration::from_millis(100));
    let tell = &mut |what| spinner.set_message(what);
    let found = cycle_limit::best_clip(encoder, evaluator, &candidates, goal, limit, tell);
    spinner.finish_and_clear();
    let found = found?;
    eprintln!(
        "{}: {}; a frame takes at most {} cycles on {}, {:.4} cm",
        args.output.display(),
        cycle_limit::describe(&found.encoding),
        found.cycles_max,
        limit.core.name(),
        found.encoded.errors.mean_joint_cm
    );
    Ok((found.encoded.bytes, found.encoding.codec.id()))
}
