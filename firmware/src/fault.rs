//! What can go wrong with a puppet, and how the player notices.
//!
//! A fault latches: the puppet stays in the state that its [`Policy`](crate::map::Policy) names until someone
//! acknowledges. docs/SAFETY.md lists each with the time that it takes and the test that shows it.

use crate::collect::{collect, numbered};
use crate::map::Settings;
use core::fmt;
use decoder_core::Error;
use heapless::Vec;
use servo_wire::bus::{
    BusError, ERROR_ALERT, ERROR_ENCODER, ERROR_HEAT, ERROR_OVERLOAD, ERROR_SHOCK, ERROR_VOLTAGE,
    ERROR_WATCHDOG, Reading,
};

/// A fault. Servos are numbered as in the joint map, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Fault {
    /// A servo does not answer.
    Silent {
        /// The servo.
        servo: u8,
    },
    /// A servo is at its highest temperature, or says so itself.
    Overheated {
        /// The servo.
        servo: u8,
    },
    /// A servo says that its load is too high.
    Overloaded {
        /// The servo.
        servo: u8,
    },
    /// The supply is too low, or a servo says that it is out of its range.
    Voltage {
        /// The servo.
        servo: u8,
    },
    /// A servo reports another hardware error.
    Hardware {
        /// The servo.
        servo: u8,
        /// Bits of [`Reading::hardware_error`].
        bits: u8,
    },
    /// A servo has stopped by itself, since its bus was silent.
    ServoWatchdog {
        /// The servo.
        servo: u8,
    },
    /// A servo has restarted: it lets go, and has forgotten its goal.
    Rebooted {
        /// The servo.
        servo: u8,
    },
    /// A servo refused what it was told.
    Refused {
        /// The servo.
        servo: u8,
        /// Why.
        error: BusError,
    },
    /// No servo of a bus can be reached: it is cut or shorted.
    Bus {
        /// Why.
        error: BusError,
    },
    /// The one who streams, or who has to be there, is gone.
    LinkLost,
    /// The clip that plays is damaged.
    Clip {
        /// Where.
        error: Error,
    },
    /// A clip that was to come next is not there, or does not fit the puppet.
    NoClip {
        /// Its number.
        clip: u16,
    },
    /// Ticks came too late, several in a row.
    Late,
    /// The controller has restarted by itself: its supply broke in, or its watchdog bit.
    Restarted,
    /// A servo's shaft stays away from what it is told.
    NotFollowing {
        /// The servo.
        servo: u8,
        /// What it was told last, in goal units.
        goal: i32,
        /// Where it is.
        position: i32,
    },
    /// A servo stands outside its range, and the shorter way back leads over the end of its turn, where it cannot go.
    BeyondTurn {
        /// The servo.
        servo: u8,
        /// Where it is.
        position: i32,
    },
}

impl Fault {
    /// The fault as a sentence in which `who` names a servo, which is numbered as in the joint map: with its id, and the name of
    /// its joint where that is known.
    pub const fn naming<W: Fn(u8, &mut fmt::Formatter<'_>) -> fmt::Result>(self, who: W) -> Naming<W> {
        Naming { fault: self, who }
    }

    /// The servo that has it, as numbered in the joint map.
    pub const fn servo(&self) -> Option<u8> {
        match *self {
            Self::Silent { servo }
            | Self::Overheated { servo }
            | Self::Overloaded { servo }
            | Self::Voltage { servo }
            | Self::Hardware { servo, .. }
            | Self::ServoWatchdog { servo }
            | Self::Rebooted { servo }
            | Self::Refused { servo, .. }
            | Self::NotFollowing { servo, .. }
            | Self::BeyondTurn { servo, .. } => Some(servo),
            Self::Bus { .. }
            | Self::LinkLost
            | Self::Clip { .. }
            | Self::NoClip { .. }
            | Self::Late
            | Self::Restarted => None,
        }
    }
}

/// [`Fault::naming`].
#[derive(Clone, Copy, Debug)]
pub struct Naming<W> {
    fault: Fault,
    who: W,
}

impl<W: Fn(u8, &mut fmt::Formatter<'_>) -> fmt::Result> fmt::Display for Naming<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(servo) = self.fault.servo() {
            (self.who)(servo, f)?;
        }
        match self.fault {
            Fault::Silent { .. } => f.write_str(" does not answer"),
            Fault::Overheated { .. } => f.write_str(" is too hot"),
            Fault::Overloaded { .. } => f.write_str(" is overloaded"),
            Fault::Voltage { .. } => f.write_str(" has a supply out of range"),
            Fault::Hardware { bits, .. } => write!(f, " reports hardware error {bits:#04x}"),
            Fault::ServoWatchdog { .. } => f.write_str(" stopped, since its bus was silent"),
            Fault::Rebooted { .. } => f.write_str(" has restarted"),
            Fault::Refused { error, .. } => write!(f, ": {error}"),
            Fault::Bus { error } => write!(f, "no servo can be reached: {error}"),
            Fault::LinkLost => f.write_str("the link is lost"),
            Fault::Clip { error } => write!(f, "the clip is damaged: {error}"),
            Fault::NoClip { clip } => write!(f, "clip {clip} is not there, or does not fit the puppet"),
            Fault::Late => f.write_str("ticks come too late"),
            Fault::Restarted => f.write_str("the controller has restarted by itself"),
            Fault::NotFollowing { goal, position, .. } => write!(
                f,
                " does not follow: it is told {goal} and stays at {position}; free its shaft, or see whether its operating mode, \
                 its position limits and its torque limit let it move"
            ),
            Fault::BeyondTurn { position, .. } => write!(
                f,
                " stands at {position}, outside its range, and its shorter way back leads over the end of its turn, where it cannot \
                 go: it is let go, so turn it by hand into its range, and begin again"
            ),
        }
    }
}

/// A servo is named by its place in the map: [`Fault::naming`] says more.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.naming(|servo, f| write!(f, "the servo at place {servo} of the map")).fmt(f)
    }
}

/// Time in ms after which what stays wrong is a fault: with the braking that follows, a defined state is reached within 100.
pub const PATIENCE_MILLIS: u16 = 60;

/// Ticks without a reading after which a servo's goal stands still until it is read again, and ticks of movement that its goal
/// may then be away from it. One lost answer is noise, and stops nothing.
pub const UNHEARD_TICKS: u8 = 2;

/// What a tick has shown, for the next one.
#[derive(Clone, Copy, Debug)]
pub struct Feedback<'a> {
    /// Of every servo, in the map's order; `None` where it did not answer or cannot.
    pub readings: &'a [Option<Reading>],
    /// How the goals were sent and the readings came.
    pub bus: Result<(), BusError>,
    /// How the last plan's action went, if it had one.
    pub action: Option<Result<(), BusError>>,
    /// Whether the tick began after the next one was due.
    pub late: bool,
}

/// Counts what stays wrong.
#[derive(Clone, Debug)]
pub struct FaultDetector<const N: usize> {
    patience: u8,
    silent: Vec<u8, N>,
    low: Vec<u8, N>,
    any_missed: bool,
    any_lost: bool,
    any_slack: bool,
    dead: u8,
    late: u8,
}

impl<const N: usize> FaultDetector<N> {
    /// Nothing has been wrong with `servos` servos.
    pub fn new(settings: &Settings, servos: usize) -> Self {
        let none = || collect((0..servos).map(|_| 0));
        let ticks = u32::from(PATIENCE_MILLIS).saturating_mul(settings.tick_hz.into()) / 1000;
        Self {
            patience: ticks.clamp(1, 60) as u8,
            silent: none(),
            low: none(),
            any_missed: false,
            any_lost: false,
            any_slack: false,
            dead: 0,
            late: 0,
        }
    }

    /// Whether any servo that can be read was silent in the last tick.
    pub const fn any_missed(&self) -> bool {
        self.any_missed
    }

    /// Whether a servo that can be read was silent in the last tick.
    pub fn missed(&self, servo: usize) -> bool {
        self.silent.get(servo).is_some_and(|&silent| silent > 0)
    }

    /// Whether a servo has been silent for [`UNHEARD_TICKS`].
    pub fn unheard(&self, servo: usize) -> bool {
        self.silent.get(servo).is_some_and(|&silent| silent >= UNHEARD_TICKS)
    }

    /// Whether any servo has been silent for so long that it may be anywhere.
    pub const fn any_lost(&self) -> bool {
        self.any_lost
    }

    /// Whether any servo has said that its motor is off.
    pub const fn any_slack(&self) -> bool {
        self.any_slack
    }

    /// Whether a servo has been silent for so long that it may be anywhere.
    pub fn lost(&self, servo: usize) -> bool {
        self.silent.get(servo).is_some_and(|&silent| silent >= self.patience)
    }

    /// Whether all servos that can be read are lost; false where none can.
    pub fn all_lost(&self, reads: impl Fn(usize) -> bool) -> bool {
        let mut readable = (0..self.silent.len()).filter(|&servo| reads(servo));
        self.any_lost && readable.all(|servo| self.lost(servo))
    }

    /// The first fault that a tick's feedback shows. `reads` tells the servos that can be read, `armed` those that were
    /// told to hold.
    pub fn detect(
        &mut self,
        settings: &Settings,
        feedback: &Feedback<'_>,
        reads: impl Fn(usize) -> bool,
        armed: impl Fn(usize) -> bool,
    ) -> Option<Fault> {
        let patience = self.patience;
        let mut fault = None;
        (self.any_missed, self.any_lost, self.any_slack) = (false, false, false);
        let counted = |count: &mut u8, wrong: bool| {
            *count = if wrong { count.saturating_add(1) } else { 0 };
            *count >= patience
        };
        let limit = if settings.temperature_limit > 0 { settings.temperature_limit } else { u8::MAX };
        let counts = self.silent.iter_mut().zip(&mut self.low);
        for (index, ((silent, low), reading)) in numbered(counts.zip(feedback.readings)) {
            let servo = index as u8;
            let found = if let Some(reading) = reading {
                *silent = 0;
                let below = reading.millivolts.is_some_and(|found| found < settings.min_millivolts);
                let hot = reading.temperature.is_some_and(|found| found >= limit);
                let slack = reading.torque == Some(false);
                if !(below || hot || slack || reading.hardware_error != 0) {
                    *low = 0;
                    continue;
                }
                self.any_slack |= slack;
                let low = counted(low, below);
                if reading.hardware_error != 0 || hot {
                    hardware(servo, reading.hardware_error, hot)
                } else if low {
                    Some(Fault::Voltage { servo })
                } else if slack && armed(index) {
                    Some(Fault::Rebooted { servo })
                } else {
                    continue;
                }
            } else {
                let gone = counted(silent, reads(index));
                self.any_missed |= *silent > 0;
                self.any_lost |= gone;
                gone.then_some(Fault::Silent { servo })
            };
            fault = fault.or(found);
        }
        // All at once is rather the bus.
        if let (true, Err(error)) = (counted(&mut self.dead, feedback.bus.is_err()), feedback.bus) {
            fault = Some(Fault::Bus { error });
        }
        let late = counted(&mut self.late, feedback.late);
        fault.or(late.then_some(Fault::Late))
    }
}

/// What a servo says of itself.
fn hardware(servo: u8, bits: u8, hot: bool) -> Option<Fault> {
    let has = |bit: u8| bits & bit != 0;
    if hot || has(ERROR_HEAT) {
        Some(Fault::Overheated { servo })
    } else if has(ERROR_OVERLOAD) {
        Some(Fault::Overloaded { servo })
    } else if has(ERROR_VOLTAGE) {
        Some(Fault::Voltage { servo })
    } else if has(ERROR_ENCODER | ERROR_SHOCK | ERROR_ALERT) {
        Some(Fault::Hardware { servo, bits })
    } else if has(ERROR_WATCHDOG) {
        Some(Fault::ServoWatchdog { servo })
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WELL: Reading = Reading {
        position: 0,
        temperature: Some(40),
        millivolts: Some(12_000),
        load: None,
        hardware_error: 0,
        torque: Some(true),
    };

    type Shown = (Vec<Option<Reading>, 2>, Result<(), BusError>, bool);

    /// The tick, from 1, in which a fault is seen first.
    fn seen(feedback: &dyn Fn(u32) -> Shown) -> Option<(u32, Fault)> {
        let settings = Settings { min_millivolts: 9_000, ..Settings::new(100) };
        let mut detector = FaultDetector::<2>::new(&settings, 2);
        (1..50).find_map(|tick| {
            let (readings, bus, late) = feedback(tick);
            let feedback = Feedback { readings: &readings, bus, action: None, late };
            detector.detect(&settings, &feedback, |_| true, |_| true).map(|fault| (tick, fault))
        })
    }

    fn second(reading: Option<Reading>) -> Shown {
        ([Some(WELL), reading].into_iter().collect(), Ok(()), false)
    }

    #[test]
    fn what_stays_wrong_is_seen_in_time_and_what_passes_is_not() {
        assert_eq!(seen(&|_| second(Some(WELL))), None);
        assert_eq!(seen(&|_| second(None)), Some((6, Fault::Silent { servo: 1 })));
        assert_eq!(seen(&|tick| second((tick % 6 == 0).then_some(WELL))), None);
        let low = Reading { millivolts: Some(8_999), ..WELL };
        assert_eq!(seen(&|_| second(Some(low))), Some((6, Fault::Voltage { servo: 1 })));
        let none = || [None, None].into_iter().collect();
        let dead = seen(&|_| (none(), Err(BusError::NoReply), false));
        assert_eq!(dead, Some((6, Fault::Bus { error: BusError::NoReply })));
        assert_eq!(seen(&|_| (second(Some(WELL)).0, Ok(()), true)), Some((6, Fault::Late)));
        assert_eq!(seen(&|tick| (second(Some(WELL)).0, Ok(()), tick % 6 > 0)), None);
    }

    #[test]
    fn what_a_servo_says_counts_at_once() {
        let with = |change: fn(&mut Reading)| {
            let mut reading = WELL;
            change(&mut reading);
            seen(&move |_| second(Some(reading)))
        };
        let servo = 1;
        assert_eq!(with(|r| r.temperature = Some(70)), Some((1, Fault::Overheated { servo })));
        assert_eq!(with(|r| r.temperature = Some(69)), None);
        assert_eq!(with(|r| r.torque = Some(false)), Some((1, Fault::Rebooted { servo })));
        for (bit, fault) in [
            (ERROR_HEAT, Fault::Overheated { servo }),
            (ERROR_OVERLOAD, Fault::Overloaded { servo }),
            (ERROR_VOLTAGE, Fault::Voltage { servo }),
            (ERROR_SHOCK, Fault::Hardware { servo, bits: ERROR_SHOCK }),
            (ERROR_WATCHDOG, Fault::ServoWatchdog { servo }),
        ] {
            let reading = Reading { hardware_error: bit, ..WELL };
            assert_eq!(seen(&move |_| second(Some(reading))), Some((1, fault)));
        }
    }
}
