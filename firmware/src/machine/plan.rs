//! What a machine is told, and what it wants.

use crate::clock::Speed;
use serde::{Deserialize, Serialize};
use servo_wire::bus::Goal;

/// What a puppet can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Play a clip now; what plays fades into it, and what was queued is dropped.
    Play {
        /// Number of the clip in the library.
        clip: u16,
        /// Whether it begins again after its end.
        repeats: bool,
    },
    /// Play a clip after those that play and wait.
    Queue {
        /// Number of the clip in the library.
        clip: u16,
        /// Whether it begins again after its end.
        repeats: bool,
    },
    /// Slow down to a stop on the clip's path; what breathes goes on.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Play at this speed.
    Speed(Speed),
    /// Fade to another frame of the clip that plays.
    Seek {
        /// Number of the frame.
        frame: u32,
    },
    /// An outside clock (audio, timecode) is at this frame of the clip.
    Sync {
        /// Number of the frame.
        frame: u32,
        /// Part of the next one, in 1/65536.
        fraction: u16,
    },
    /// Leave the clip, slow down, and hold the pose.
    Stop,
    /// Leave the clip, and go to the home pose slowly.
    Home,
    /// The trigger input was set: play the clip that the show has for it, if no other one plays that is no idle clip.
    Trigger,
    /// The link that has to be there is gone.
    LinkLost,
    /// Someone has looked at the fault: begin again from finding the servos, and go on with what played.
    Acknowledge,
}

/// Where a puppet is. A fault may be latched in each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Plays, or is paused.
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
}

/// One thing besides goals and readings that a bus is asked in a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Is this servo there?
    Ping {
        /// The servo, as numbered in the map.
        servo: usize,
    },
    /// Turn a servo on where it is.
    TorqueOn {
        /// The servo.
        servo: usize,
    },
    /// Let all servos go.
    TorqueOff,
    /// Restart a servo that says it has a hardware error.
    Reboot {
        /// The servo.
        servo: usize,
    },
    /// Set the servos' own watchdogs, 0 to disarm them.
    Watchdog {
        /// Silence that they bear, in ms.
        millis: u16,
    },
}

/// What a tick asks of the buses.
#[derive(Debug)]
pub struct Plan<'a> {
    /// To send, one a servo in the map's order; empty while the servos are looked for.
    pub goals: &'a [Goal],
    /// To do after the goals were sent.
    pub action: Option<Action>,
}

/// What a puppet does after its clips.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum After {
    /// It holds the last pose.
    Hold,
    /// It goes home.
    #[default]
    Home,
}

/// What a puppet plays by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Show<'s> {
    /// Clips to play from power on, in order.
    pub playlist: &'s [u16],
    /// Whether the playlist begins again.
    pub repeats: bool,
    /// Clip to repeat while nothing else plays.
    pub idle_clip: Option<u16>,
    /// Clip that the trigger starts.
    pub trigger_clip: Option<u16>,
    /// What comes after the clips.
    pub after: After,
}

/// How the controller came up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Its power came on, or someone reset it.
    Power,
    /// Its watchdog bit, or its supply broke in: nothing plays before that is acknowledged.
    ByItself,
}
