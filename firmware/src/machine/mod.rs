//! The state machine of a puppet: from power on to rest, and to a safe state from every fault.
//!
//! ```text
//! Finding -> Reading -> Arming -> Opening -> Easing -> Playing -> Stopping -> Holding
//!    ^                                          |         |          |           |
//!    |                                          +--> Resting <- Easing home <----+
//!    +--- acknowledge --- Holding, Resting or Limp, with a fault latched  <--- any fault
//! ```
//!
//! Pure: a tick takes what the last one has shown ([`Feedback`](crate::fault::Feedback)) and gives a [`TickOutput`]. [`control_loop`](mod@crate::control_loop) carries
//! it out. No goal ever leaves a servo's range, or moves faster or with more acceleration than the map allows; that
//! is [`limits`](crate::limits), behind everything here.

mod command;
mod ideal_servos;
mod lost_servos;
mod off_goal;

mod start;
mod state;
mod state_machine;
#[cfg(test)]
pub(crate) mod test_puppet;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_of_playing;
#[cfg(test)]
mod tests_off_goal;
mod tick_output;
mod watched;

pub use crate::show::{After, Show};
pub use command::Command;
pub use ideal_servos::IdealServos;
pub use off_goal::{FOLLOW_MILLIS, LET_GO_MILLIS};
pub use state::{Start, State};
pub use state_machine::Machine;
pub use tick_output::{Action, TickOutput};
