//! `bunraku info` of a recording or a skeleton.

use crate::commands::input;
use host_sim::terminal;
use mocap::import::unit;
use mocap::skeleton::Dof;
use mocap::survey::Survey;
use mocap::{Clip, Motion, Skeleton};
use std::path::Path;

const fn unit_of(dof: Dof) -> &'static str {
    if dof.is_rotation() { "degrees" } else { "cm" }
}

/// Prints what the recording holds.
pub fn print(file: &Path, clip: &Clip, all_channels: bool, json: bool) {
    let Clip { skeleton, motion } = clip;
    let survey = Survey::of(clip);
    let height = unit::height(clip, [0.0; 3]);
    let flips = |joint: usize| survey.flips.iter().find(|flips| flips.joint == joint);
    if json {
        let channels: Vec<_> = (skeleton.channels.iter().zip(&survey.channels))
            .map(|(channel, found)| {
                serde_json::json!({
                    "name": channel.name, "unit": unit_of(channel.dof), "low": found.low, "high": found.high,
                    "speed": found.speed, "turns": found.turns, "wraps": found.wraps,
                })
            })
            .collect();
        let flips: Vec<_> = (survey.flips.iter())
            .map(|flips| serde_json::json!({ "joint": skeleton.joints[flips.joint].name, "frames": flips.frames }))
            .collect();
        let jump = survey.jump.as_ref().map(|jump| {
            serde_json::json!({ "channel": skeleton.channels[jump.channel].name, "degrees": jump.degrees })
        });
        let report = serde_json::json!({
            "file": file, "frames": motion.frames(), "fps": motion.fps, "joints": skeleton.joints.len(),
            "height_cm": height, "first_frame_jump": jump, "flips": flips, "channels": channels,
        });
        println!("{report:#}");
        return;
    }
    let (frames, fps) = (motion.frames(), motion.fps);
    println!(
        "{}: motion, {frames} frames at {} fps, {:.2} s",
        file.display(),
        input::short(fps),
        frames as f64 / fps
    );
    println!(
        "  {} joints, {} channels; {:.2} m from the lowest joint to the highest",
        skeleton.joints.len(),
        motion.channels,
        height / 100.0
    );
    if let Some(jump) = &survey.jump {
        println!(
            "  frame 0 is apart from the others ({} jumps by {:.0} degrees), perhaps a T-pose: --frames 1.. leaves it out",
            skeleton.channels[jump.channel].name, jump.degrees
        );
    }
    for flips in &survey.flips {
        let (count, first) = (flips.frames.len(), flips.frames[0]);
        println!(
            "  {}: all three angles flip {count} times (first in frame {first}), and the pose does not",
            skeleton.joints[flips.joint].name
        );
    }
    let still = survey.channels.iter().filter(|channel| channel.low == channel.high).count();
    if still > 0 && !all_channels {
        println!("  {still} channels stand still (--channels lists them too)");
    }
    let width = skeleton
        .channels
        .iter()
        .map(|channel| terminal::name(&channel.name).chars().count())
        .max()
        .unwrap_or(0)
        .max(18);
    println!(
        "  {:<width$} {:>10} {:>10} {:>12}  turns  jumps by a turn",
        "channel", "low", "high", "speed per s"
    );
    for (channel, found) in skeleton.channels.iter().zip(&survey.channels) {
        if found.low == found.high && !all_channels {
            continue;
        }
        let note = if flips(channel.joint).is_some() && channel.dof.is_rotation() { "  flips" } else { "" };
        println!(
            "  {:<width$} {:>10.3} {:>10.3} {:>12.1} {:>6} {:>6} {}{note}",
            terminal::name(&channel.name),
            found.low,
            found.high,
            found.speed,
            found.turns,
            found.wraps,
            unit_of(channel.dof)
        );
    }
}

/// Prints what the skeleton holds.
pub fn print_skeleton(file: &Path, skeleton: &Skeleton, json: bool) {
    let channels = skeleton.channels.len();
    let rest = Motion { fps: 1.0, channels, samples: vec![0.0; channels] };
    let height = unit::height(&Clip { skeleton: skeleton.clone(), motion: rest }, [0.0; 3]);
    if json {
        let channels: Vec<_> = (skeleton.channels.iter())
            .map(|channel| {
                serde_json::json!({
                    "name": channel.name, "unit": unit_of(channel.dof), "limits": channel.limits,
                })
            })
            .collect();
        let joints: Vec<_> = (skeleton.joints.iter())
            .map(|joint| {
                let parent = joint.parent.map(|parent| skeleton.joints[parent].name.as_str());
                serde_json::json!({ "name": joint.name, "parent": parent })
            })
            .collect();
        let report = serde_json::json!({
            "file": file, "height_cm": height, "joints": joints, "channels": channels,
        });
        println!("{report:#}");
        return;
    }
    println!(
        "{}: skeleton, {} joints, {channels} channels; {:.2} m from the lowest joint to the highest at rest",
        file.display(),
        skeleton.joints.len(),
        height / 100.0
    );
    println!("  {:<20}  limits", "channel");
    for channel in &skeleton.channels {
        let limits = channel.limits.map_or_else(String::new, |(low, high)| format!("{low} to {high}"));
        println!("  {:<20}  {limits} {}", terminal::name(&channel.name), unit_of(channel.dof));
    }
}
