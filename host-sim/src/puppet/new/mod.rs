//! A first puppet for a recorded figure: which servos it has, what each of them follows, how far and how fast it goes.
//!
//! 1. The parts of the figure's body say which joints there may be ([`unit`](Unit)): a head that turns and nods,
//!    shoulders of two servos, elbows, hips, knees, ankles, and a waist that turns.
//! 2. Of two ways to put the servos of a shoulder or hip, the one that follows the recording better is taken.
//! 3. The recording is fitted to joints without ranges. Where there are more joints than servos, those that move most
//!    are taken: by the standard deviation of their values.
//! 4. Each joint's range is that of its values and a margin, within what the kind of servo can. Its speed is the
//!    highest of the recording and a margin, at most what a usual servo can.

mod figure;
mod proposal;
mod propose;
mod servo;
mod text;
mod unit;

pub use figure::Figure;
pub use proposal::{Joint, Proposal, Proposed, Wish};
pub use propose::{FOUR_LEGS, propose};
pub use servo::Servo;
pub use text::text;
pub use unit::{Axis, Group, Unit};
