//! Motion capture in and out, forward kinematics, and how far two motions are apart.
//!
//! - [`import`] reads ASF/AMC, BVH, GLB, CSV and moves as JSON; [`export`] writes AMC, BVH, GLB, CSV and JSON.
//! - A [`Clip`] is a [`Skeleton`] (joints and named channels) and a [`Motion`] (frames of channel values).
//!   Rotations are in degrees and lengths in centimetres, whatever the file's units were.
//! - [`body`] says which joint is which part of the body, and how each bone is turned from the T-pose.
//! - [`kinematics`] says where a pose puts the joints, and how far each channel moves them.
//! - [`metrics`] compares a motion with its original, in centimetres and in degrees.
//! - [`sample`] is a clip from formulas, for tests and examples: it needs no file.
//!
//! Any bytes give `Ok` or `Err`: an importer never panics.
//!
//! ```
//! use mocap::kinematics::Kinematics;
//! use mocap::{metrics, sample};
//!
//! // A puppet of 19 joints walks and waves for 8 seconds. A file is read by `mocap::import::load`.
//! let clip = sample::clip();
//! assert_eq!((clip.motion.frames(), clip.motion.fps), (480, 60.0));
//!
//! // Where are the joints in the first frame? In centimetres; the root is joint 0.
//! let mut kinematics = Kinematics::new(&clip.skeleton);
//! let mut positions = vec![[0.0; 3]; kinematics.joints()];
//! kinematics.positions(clip.motion.frame(0), &mut positions);
//! assert!(positions[0][1] > 20.0, "the hips are above the floor");
//!
//! // What does it cost to keep whole degrees and centimetres only?
//! let mut rounded = clip.motion.clone();
//! rounded.samples.iter_mut().for_each(|value| *value = value.round());
//! let report = metrics::compare(&clip.skeleton, &clip.motion, &rounded, 480 * 31)?;
//! assert!(report.rms_deg < 0.3 && report.max_joint_cm < 2.0);
//! # Ok::<(), metrics::CompareError>(())
//! ```
#![forbid(unsafe_code)]

pub mod angles;
pub mod body;
mod clip;
pub mod export;
pub mod import;
pub mod kinematics;
pub mod metrics;
pub mod motion;
pub mod quaternion;
mod resample;
pub mod sample;
pub mod skeleton;
pub mod survey;

pub use clip::Clip;
pub use motion::Motion;
pub use resample::resample;
pub use skeleton::Skeleton;

/// The example of the README, which is run like the others.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
