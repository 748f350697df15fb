//! `bunraku compare`: how far a clip is from the motion that it was made of.

use super::{input, joints};
use anyhow::{Context, Result};
use host_sim::files;
use host_sim::terminal;
use mocap::metrics;
use puppet_file::Puppet;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare a clip with the motion that it was made of.
///
/// DEF is the displacement error per frame: distances between joints after forward kinematics, summed over the
/// joints (def_sum_cm) or their mean (mean_joint_cm), averaged over the frames. moving_joint_cm is the mean over the joints and
/// frames that move alone. max_point_cm is the greatest distance of any point 3 cm off a bone, the measure of the Animation
/// Compression Library. Channels are matched by their names; a .qmd has none, and has them in order.
///
/// With --puppet also how far each of its joints is from what was recorded, as the player tells the servos.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku compare 02_01.amc walk.qmd --skeleton 02.asf --json\n\nWith --max-error the exit code is 1 where the mean joint error is larger."
)]
pub struct Args {
    /// The recording that was encoded: .bvh, .amc, .glb, .csv or .json.
    reference: PathBuf,
    /// The clip, or another motion of the same channels.
    clip: PathBuf,
    #[command(flatten)]
    source: input::Source,
    /// Fail where the mean joint error is above this.
    #[arg(long, value_name = "CM", value_parser = super::number::from_zero)]
    max_error: Option<f64>,
    /// Joints to list, the worst first.
    #[arg(long, default_value_t = 5)]
    worst: usize,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<ExitCode> {
    let reference = args.source.load(&args.reference)?;
    let (clip, bytes) = args.source.load_any(&args.clip, &reference)?;
    let mut report = metrics::compare(&reference.skeleton, &reference.motion, &clip.motion, bytes)
        .with_context(|| {
            format!("cannot compare {} with {}", args.clip.display(), args.reference.display())
        })?;
    report.worst_joints.truncate(args.worst);
    let joints = match args.source.puppet.as_deref() {
        Some(puppet) if input::is_clip(&args.clip) => {
            let (puppet, bytes) = (Puppet::read(puppet)?, files::read(&args.clip)?);
            Some(joints::Table::of_recording(&args.clip, &bytes, &puppet, &reference)?)
        }
        _ => None,
    };
    if args.json {
        let mut report = serde_json::to_value(&report)?;
        report["joints"] = serde_json::to_value(&joints)?;
        println!("{report:#}");
    } else {
        print(&report);
        if let Some(joints) = joints {
            println!();
            joints.print();
        }
    }
    match args.max_error {
        Some(limit) if report.mean_joint_cm > limit => {
            eprintln!("bunraku: the mean joint error is {:.4} cm, above {limit} cm", report.mean_joint_cm);
            Ok(ExitCode::FAILURE)
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}

fn print(report: &metrics::Report) {
    println!("{} frames of {} channels at {} fps", report.frames, report.channels, report.fps);
    println!("  size             {} bytes, {:.2} times smaller than float32", report.bytes, report.ratio_f32);
    println!("  DEF, sum         {:.4} cm", report.def_sum_cm);
    println!("  DEF, mean        {:.5} cm a joint", report.mean_joint_cm);
    println!("  DEF, moving      {:.5} cm a joint, where it moves", report.moving_joint_cm);
    println!(
        "  worst frame      {:.4} cm, {:.4} cm 3 cm off the bone",
        report.max_joint_cm, report.max_point_cm
    );
    println!("  rotations, RMS   {:.5} degrees", report.rms_deg);
    match report.psnr_db {
        Some(psnr) => println!("  PSNR             {psnr:.2} dB"),
        None => println!("  PSNR             not defined: no error, or no movement"),
    }
    println!("  worst joints     mean cm   max cm");
    for joint in &report.worst_joints {
        let name = terminal::name(&joint.name);
        println!("  {name:<15} {:>8.4} {:>8.4}", joint.mean_cm, joint.max_cm);
    }
}
