//! A joint's place and rotation in its parent's axes, in a pose.

use crate::angles::{self, Matrix};
use crate::skeleton::{Dof, Joint, Skeleton};

/// The channel that changes the length of a joint's bone.
pub(super) fn length_channel(skeleton: &Skeleton, joint: &Joint) -> Option<usize> {
    joint.channels.clone().find(|&channel| skeleton.channels[channel].dof == Dof::Length)
}

/// C · R · C⁻¹ of a joint.
pub(super) fn local_rotation(skeleton: &Skeleton, joint: &Joint, pose: &[f64]) -> Matrix {
    let factors = joint.rotations.iter().filter_map(|&channel| {
        let axis = skeleton.channels[channel].dof.axis()?;
        Some(angles::rotation(axis, pose[channel]))
    });
    let rotation = factors.fold(joint.axis, |product, factor| angles::multiply(&product, &factor));
    angles::multiply(&rotation, &angles::transpose(&joint.axis))
}

/// A joint's origin in its parent's rest axes: offset, the parent's lengthening and C · translations.
pub(super) fn local_position(skeleton: &Skeleton, joint: &Joint, pose: &[f64]) -> [f64; 3] {
    let mut translation = [0.0; 3];
    for channel in joint.channels.clone() {
        let dof = skeleton.channels[channel].dof;
        if let Some(axis) = dof.axis()
            && !dof.is_rotation()
        {
            translation[axis] = pose[channel];
        }
    }
    let translation = angles::apply(&joint.axis, translation);
    let parent = joint.parent.map(|parent| &skeleton.joints[parent]);
    let lengthened = parent.and_then(|parent| {
        let channel = length_channel(skeleton, parent)?;
        let length = parent.tail.iter().map(|part| part * part).sum::<f64>().sqrt();
        Some(parent.tail.map(|part| part / length * pose[channel]))
    });
    let lengthened = lengthened.unwrap_or_default();
    std::array::from_fn(|k| joint.offset[k] + lengthened[k] + translation[k])
}
