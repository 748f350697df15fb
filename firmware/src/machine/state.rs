//! Where a puppet is, and how its controller came up.

use serde::Serialize;

/// Where a puppet is. A fault may be latched in each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Looks for its servos, one a tick.
    Finding,
    /// Reads where the servos are.
    Reading,
    /// Turns the servos on where they are.
    Arming,
    /// Decodes towards the frame that it is to start with, and holds the pose.
    Opening,
    /// On its way to a clip's pose.
    Easing,
    /// Plays.
    Playing,
    /// Brakes.
    Stopping,
    /// Holds a pose.
    Holding,
    /// On its way home.
    Returning,
    /// At home.
    Resting,
    /// The servos were let go.
    Limp,
    /// Stands in a clip, or slows down to that, until somebody resumes, stops or plays another one. What breathes goes on.
    Paused,
}

/// How the controller came up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Its power came on, or someone reset it.
    Power,
    /// Its watchdog bit, or its supply broke in: nothing plays before that is acknowledged.
    ByItself,
}
