//! Fit: from a recorded figure to the joints of a puppet.
//!
//! A recording has the angles of a figure's bones, a puppet has servos. A [`Plan`] says what each joint of the puppet
//! follows; [`fit`] gives one value for each joint and frame, in degrees (centimetres for translations), within the
//! joint's range, and a [`Report`] of what the joint cannot do.
//!
//! - A joint that follows a channel: Euler flips and whole turns are taken out, since the pose does not show them.
//! - A joint that follows a turn, or a sum of turns: the twist of the rotation itself ([`twist`]).
//! - One to three joints in a chain: the angles with which the bone points where it was recorded ([`chain`]).
//!
//! Where several values do, the whole clip decides ([`track`]): errors, steps and ways that a joint cannot make in time
//! cost. Nothing is known of servos here: this crate has numbers and [`mocap`].

#![forbid(unsafe_code)]

pub mod chain;
mod euler;
mod fitted;
mod hinge;
mod plan;
mod report;
pub mod smooth;
pub mod track;
pub mod twist;

pub use fitted::{Fitted, channel_name, fit};
pub use plan::{Bones, Chain, Follows, Joint, Plan, Turn};
pub use report::{BoneReport, Excess, JointReport, Pole, Report, TwistReport};
