//! A clip: who moves, and how.

use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// A skeleton and a motion of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// What moves.
    pub skeleton: Skeleton,
    /// How it moves: one column per channel of the skeleton.
    pub motion: Motion,
}

impl Clip {
    /// The skeleton with the bones that the figure has in the mean of all frames.
    ///
    /// Some programs (Perception Neuron, Xsens) write positions for every joint, and these move a little. Such a channel
    /// replaces the joint's offset, so that the skeleton alone has no bone there. [`Body`](crate::body::Body) and
    /// [`TPose`](crate::body::TPose) need the bone: below the root, the mean of a position channel becomes the offset.
    #[must_use]
    pub fn figure(&self) -> Skeleton {
        let mut figure = self.skeleton.clone();
        for (column, channel) in self.skeleton.channels.iter().enumerate() {
            let axis = channel.dof.axis().filter(|_| !channel.dof.is_rotation() && channel.joint > 0);
            if let Some(axis) = axis {
                let sum: f64 = self.motion.iter().map(|frame| frame[column]).sum();
                figure.joints[channel.joint].offset[axis] += sum / self.motion.frames().max(1) as f64;
            }
        }
        figure
    }
}

#[cfg(test)]
mod tests {
    use crate::import::bvh;
    use crate::kinematics::Kinematics;
    use std::fmt::Write;

    /// The positions of a knee that moves by millimetres are its bone.
    #[test]
    fn a_figure_has_the_bones_that_its_positions_say() {
        let mut text = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nJOINT Leg\n{\n\
                        OFFSET 0 -40 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
                        End Site\n{\nOFFSET 0 -40 0\n}\n}\n}\nMOTION\nFrames: 4\nFrame Time: 0.01\n"
            .to_owned();
        for frame in 0..4 {
            let aside = f64::from(frame % 2) * 0.5;
            writeln!(text, "0 90 0 {aside} {} {} 1 2 3", -40.0 - aside, 1.0 + aside).unwrap();
        }
        let clip = bvh::parse(text.as_bytes(), "a.bvh", 1.0, None).unwrap().clip;
        assert_eq!(clip.skeleton.joints[1].offset, [0.0; 3]);
        assert_eq!(clip.figure().joints[1].offset, [0.25, -40.25, 1.25]);
        assert_eq!(clip.figure().joints[0], clip.skeleton.joints[0]);
        // What is recorded is still the motion of the clip's own skeleton.
        let places = Kinematics::new(&clip.skeleton).all_positions(&clip.motion);
        assert_eq!(places[1], [0.0, 50.0, 1.0]);
    }
}
