//! The body of a figure: which joint is which part, and how each bone is turned from the T-pose.
//!
//! A puppet file names parts ("right forearm"), and skeletons name joints (`RightForeArm`, `rradius`,
//! `lowerarm_r`). [`Body`] finds the joint of each [`Part`]: by its name, and by geometry
//! where names say nothing.
//!
//! Skeletons also differ in what a channel at 0 means: arms out, arms down, or all bones along one axis. [`TPose`]
//! takes that away. It gives the rotation of each bone from the T-pose, in the figure's axes: right-handed, x to the
//! figure's left, y up, z forward. So the rotation of one bone against another does not depend on the order of Euler
//! angles, on whole turns, or on the skeleton's rest pose.
//!
//! ```
//! use mocap::body::{Body, Part, Side, TPose};
//! use mocap::{angles, sample};
//!
//! let clip = sample::clip();
//! let body = Body::of(&clip.skeleton);
//! let forearm = body.joint(Part::Forearm(Side::Right)).expect("the sample has a right forearm");
//! assert_eq!(clip.skeleton.joints[forearm].name, "rradius");
//! assert_eq!(body.find(&clip.skeleton, "right forearm"), Some(forearm));
//!
//! // How far is the elbow bent in frame 400? In degrees.
//! let upper_arm = body.joint(Part::UpperArm(Side::Right)).expect("an upper arm");
//! let mut pose = TPose::of(&clip.skeleton, &body);
//! let mut rotations = vec![angles::IDENTITY; clip.skeleton.joints.len()];
//! pose.rotations(clip.motion.frame(400), &mut rotations);
//! let elbow = angles::multiply(&angles::transpose(&rotations[upper_arm]), &rotations[forearm]);
//! let bent = angles::turned(&elbow);
//! assert!(bent > 10.0 && bent < 150.0, "{bent}");
//! ```

mod figure;
mod four_legs;
mod geometry;
mod names;
mod part;
#[cfg(test)]
mod schemes;
mod t_pose;
mod tree;

pub use figure::{Body, FoundBy};
pub use four_legs::goes_on_four_legs;
pub use part::{Part, Side};
pub use t_pose::TPose;
