//! Bones whose lengths a file keeps in position channels.

use crate::motion::Motion;
use crate::skeleton::{Channel, Joint, Skeleton};

/// How far a position may be from that of the first frame and still be a bone's, in lengths of that bone.
const STILL: f64 = 1e-4;

/// Makes bones of the position channels below the root that stand still in all frames.
pub(super) fn set_bones(skeleton: &mut Skeleton, motion: &mut Motion, notes: &mut Vec<String>) {
    let first = motion.frame(0);
    let length = |joint: &Joint| {
        let own = joint.channels.clone().filter(|&channel| !skeleton.channels[channel].dof.is_rotation());
        own.map(|channel| first[channel] * first[channel]).sum::<f64>().sqrt()
    };
    let is_bone = |&channel: &usize| {
        let Channel { dof, joint, .. } = skeleton.channels[channel];
        let slack = STILL * length(&skeleton.joints[joint]);
        let mut values = motion.samples[channel..].iter().step_by(motion.channels);
        joint > 0 && !dof.is_rotation() && values.all(|value| (value - first[channel]).abs() <= slack)
    };
    let bones: Vec<usize> = (0..motion.channels).filter(is_bone).collect();
    if bones.is_empty() || bones.len() == motion.channels {
        return;
    }
    for &channel in &bones {
        let Channel { dof, joint, .. } = skeleton.channels[channel];
        if let Some(axis) = dof.axis() {
            // Along the joint's own axis; of a BVH that is the file's.
            let Joint { axis: own, offset, .. } = &mut skeleton.joints[joint];
            (0..3).for_each(|k| offset[k] += own[k][axis] * motion.samples[channel]);
        }
    }
    notes.push(format!(
        "{} of {} channels are positions that stand still: they are the lengths of bones, and no channels",
        bones.len(),
        motion.channels
    ));
    let mut bones = bones.into_iter().peekable();
    let kept: Vec<usize> =
        (0..motion.channels).filter(|channel| bones.next_if_eq(channel).is_none()).collect();
    *skeleton = skeleton.with_channels(&kept);
    *motion = motion.with_channels(&kept);
}
