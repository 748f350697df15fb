//! `bunraku decode`: a compressed clip in, motion capture out.

use super::input::Length;
use super::number::recorded_rate;
use anyhow::{Context, Result, bail};
use decoder_core::I16F16;
use firmware::limits::FINE_BITS;
use firmware::map::Joint;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::puppet::channels;
use mocap::export;
use mocap::import::{self, GOAL, amc};
use mocap::{Motion, Skeleton};
use puppet_file::{Channels, Map, Puppet};
use std::path::PathBuf;
use std::process::ExitCode;

/// Decode a clip into AMC, BVH, CSV, GLB, or JSON as the Blender Servo Animation add-on writes it.
///
/// A clip that was made for a puppet has only some of the skeleton's channels; the others become 0. CSV needs no skeleton where
/// the clip names its channels: it then has these alone. With --puppet it has the goals of the puppet's servos, which `encode --puppet`
/// reads again.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bunraku decode walk.qmd --skeleton 02.asf -o walk.amc\n  \
    bunraku decode puppet.mclip -o puppet.csv")]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: PathBuf,
    /// The skeleton that the clip was encoded with: .asf, or .bvh for its hierarchy.
    #[arg(long, value_name = "S.asf|S.bvh")]
    skeleton: Option<PathBuf>,
    /// Unit of the lengths in a BVH skeleton, as for `bunraku encode`; guessed unless given.
    #[arg(long, value_name = "UNIT")]
    unit: Option<import::Unit>,
    /// Write what the servos of this puppet are told in each frame, within their ranges: a column NAME.goal for each joint (.csv).
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: Option<PathBuf>,
    /// Frames per second, where the clip does not say.
    #[arg(long, value_name = "F", value_parser = recorded_rate)]
    fps: Option<f64>,
    /// Where the motion goes; its extension says the format.
    #[arg(short, long, value_name = "OUT.amc|.bvh|.csv|.glb|.json")]
    output: PathBuf,
    #[command(flatten)]
    length: Length,
}

/// What says which channels the decoded motion has.
enum Layout {
    Skeleton(Skeleton),
    /// The clip itself.
    Names(Channels),
    /// The servos of a puppet.
    Goals(Box<Map>, Vec<String>),
}

pub fn run(args: Args) -> Result<ExitCode> {
    let extension = args.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !["amc", "bvh", "csv", "glb", "json"].contains(&extension.as_str()) {
        let output = args.output.display();
        bail!("{output}: found the extension {extension:?}, expected amc, bvh, csv, glb or json");
    }
    if args.puppet.is_some() && extension != "csv" {
        bail!("{}: goals of servos go into a .csv", args.output.display());
    }
    let skeleton = args.skeleton.as_deref();
    let skeleton = skeleton.map(|path| import::read_skeleton(path, args.unit)).transpose()?;
    let bytes = files::read(&args.clip)?;
    let clip = Clip::headers(&args.clip, &bytes)?;
    let (name, found) = (args.clip.display(), clip.channels());
    let layout = match (&args.puppet, skeleton, channels::of_clip(&clip)) {
        (Some(puppet), ..) => {
            let puppet = Puppet::read(puppet)?;
            let map = puppet.map(channels::of_played(&args.clip, &clip, &puppet, args.skeleton)?)?;
            let names = map.joints().iter().map(|joint| format!("{}.{GOAL}", puppet.name_of(joint)));
            let names = names.collect();
            Layout::Goals(Box::new(map), names)
        }
        (None, Some(skeleton), None) => {
            channels::check_clip(&args.clip, &clip, &Channels::from(&skeleton))?;
            Layout::Skeleton(skeleton)
        }
        (None, Some(skeleton), Some(own)) => {
            let on_it = Channels::from(&skeleton);
            if !own.names().any(|channel| on_it.find(channel).is_ok()) {
                let first = own.names().next().unwrap_or_default();
                bail!(
                    "{name} has channels of a puppet ({first} is the first), and none of the skeleton's: it was fitted with \
                     --puppet, and decodes to a .csv without --skeleton"
                );
            }
            Layout::Skeleton(skeleton)
        }
        (None, None, Some(own)) if extension == "csv" => Layout::Names(own),
        (None, None, None) if extension == "csv" => bail!(
            "{name} does not name its channels: give the skeleton that it was encoded with (--skeleton)"
        ),
        (None, None, _) => bail!(
            "{}: a .{extension} needs the skeleton that the clip was encoded with (--skeleton); only .csv does without, \
             which is also what a clip that was fitted to a puppet decodes to",
            args.output.display()
        ),
    };
    clip.check_length(&args.clip, args.length.long)?;
    let mut motion = super::input::decode(&args.clip, &bytes)?;
    match &layout {
        Layout::Skeleton(skeleton) => {
            motion = channels::on_skeleton(&args.clip, &bytes, &motion, skeleton)?;
        }
        Layout::Goals(map, _) => motion = goals(map, &motion),
        Layout::Names(_) => {}
    }
    if let Some(fps) = args.fps {
        motion.fps = fps;
    } else if motion.fps == 0.0 {
        motion.fps = amc::DEFAULT_FPS;
    }
    let frames = motion.frames();
    files::write(&args.output, |mut file| {
        match (&layout, extension.as_str()) {
            (Layout::Goals(_, names), _) => {
                export::csv::write_named(&mut file, names.iter().map(String::as_str), &motion)
            }
            (Layout::Names(names), _) => export::csv::write_named(&mut file, names.names(), &motion),
            (Layout::Skeleton(skeleton), "amc") => {
                export::amc::write(&mut file, skeleton, &motion, export::amc::Rotations::Wrapped)
            }
            (Layout::Skeleton(skeleton), "bvh") => {
                motion.wrap_angles(skeleton);
                export::bvh::write(&mut file, skeleton, &motion)
            }
            (Layout::Skeleton(skeleton), "glb") => export::glb::write(&mut file, skeleton, &motion),
            (Layout::Skeleton(skeleton), "json") => export::servo_json::write(&mut file, skeleton, &motion),
            (Layout::Skeleton(skeleton), _) => export::csv::write(&mut file, skeleton, &motion),
        }
        .with_context(|| format!("cannot write {}", args.output.display()))
    })?;
    println!("{}: {frames} frames of {found} channels", args.output.display());
    Ok(ExitCode::SUCCESS)
}

/// What the servos of a puppet are told in each frame of a motion, in the order of the map.
fn goals(map: &Map, motion: &Motion) -> Motion {
    let joints = map.joints();
    let goal = |pose: &[f64], joint: &Joint| {
        let value = I16F16::saturating_from_num(pose[usize::from(joint.channel)]);
        let fine = joint.goal(value).clamp(joint.limits().min(), joint.limits().max());
        f64::from((fine + (1 << (FINE_BITS - 1))) >> FINE_BITS)
    };
    let samples = motion.iter().flat_map(|pose| joints.iter().map(move |joint| goal(pose, joint))).collect();
    Motion { fps: motion.fps, channels: joints.len(), samples }
}
