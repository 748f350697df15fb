//! What a puppet can be told.

use crate::clock::Speed;

/// What a puppet can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// Slow down to a stop on the clip's path; what breathes goes on. Ends with resume, stop, home, a trigger and a new play.
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
