//! Which channel of one motion is which of another: by name, never by place alone where there are names.

use anyhow::{Result, bail};
use host_sim::clip::Clip as AnyClip;
use host_sim::puppet::channels;
use mocap::{Clip, Motion, Skeleton};
use std::path::Path;

/// A motion with the channels of the reference, in the reference's order.
///
/// # Errors
/// A sentence where a channel is missing or too many, and where a joint turns about its axes in another order, in which the same
/// angles are another pose.
pub fn of_motion(path: &Path, clip: &Clip, reference: &Skeleton) -> Result<Motion> {
    let names: Vec<&str> = clip.skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
    let motion = clip.motion.with_channels(&places(path, &names, reference)?);
    for (index, joint) in reference.joints.iter().enumerate() {
        let expected = order(reference, index);
        let other = clip.skeleton.joints.iter().position(|other| other.name == joint.name);
        let found = other.map_or(Vec::new(), |other| order(&clip.skeleton, other));
        if found != expected {
            bail!(
                "{}: joint {} turns about {}, expected {} as in the reference: the same angles are another pose",
                path.display(),
                joint.name,
                found.join(", then "),
                expected.join(", then ")
            );
        }
    }
    Ok(motion)
}

/// Which of a clip's channels is each of the reference's: by the names that the clip has; a clip without names has the channels
/// in order.
///
/// # Errors
/// A sentence where a channel is missing or too many.
pub fn of_clip(path: &Path, clip: &AnyClip<'_>, reference: &Skeleton) -> Result<Vec<usize>> {
    let Some(own) = channels::of_clip(clip) else {
        count(path, clip.channels(), reference)?;
        return Ok((0..clip.channels()).collect());
    };
    places(path, &own.names().collect::<Vec<_>>(), reference)
}

fn places(path: &Path, names: &[&str], reference: &Skeleton) -> Result<Vec<usize>> {
    count(path, names.len(), reference)?;
    let mut kept = Vec::new();
    for channel in &reference.channels {
        let Some(place) = names.iter().position(|name| *name == channel.name) else {
            bail!(
                "{} has no channel {}, which the reference has; it has {}",
                path.display(),
                channel.name,
                shortened(names)
            );
        };
        kept.push(place);
    }
    Ok(kept)
}

fn count(path: &Path, found: usize, reference: &Skeleton) -> Result<()> {
    let expected = reference.channels.len();
    if found != expected {
        let hint = if found < expected { "; a clip for a puppet is compared with --puppet" } else { "" };
        bail!("{} has {found} channels, expected {expected} as in the reference{hint}", path.display());
    }
    Ok(())
}

/// The first names of many.
fn shortened(names: &[&str]) -> String {
    let first = names.iter().take(6).copied().collect::<Vec<_>>().join(", ");
    if names.len() > 6 { format!("{first} and {} more", names.len() - 6) } else { first }
}

/// The axes that a joint turns about, in turn.
fn order(skeleton: &Skeleton, joint: usize) -> Vec<&'static str> {
    let rotations = skeleton.joints[joint].rotations.iter();
    rotations
        .filter_map(|&channel| skeleton.channels[channel].dof.axis())
        .filter_map(|axis| ["x", "y", "z"].get(axis).copied())
        .collect()
}
