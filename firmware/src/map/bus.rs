//! What servos hang on.

use crate::numbered::numbered;
use core::ops::RangeInclusive;
use serde::{Deserialize, Serialize};

numbered! {
    /// What servos hang on.
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    pub enum BusKind {
        /// Dynamixel protocol 2.0.
        Dynamixel = 0,
        /// Dynamixel protocol 1.0 (AX, MX).
        Dynamixel1 = 1,
        /// Feetech STS.
        Sts = 2,
        /// Feetech SCS.
        Scs = 3,
        /// Hobby servos on the controller's own timers; ids count its outputs.
        Pwm = 4,
        /// Hobby servos on a PCA9685; ids are its channels.
        Pca9685 = 5,
        /// The Blender Servo Animation add-on's live frames.
        Blender = 6,
    }
}

impl BusKind {
    /// Its name in puppet.toml.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dynamixel => "dynamixel",
            Self::Dynamixel1 => "dynamixel1",
            Self::Sts => "sts",
            Self::Scs => "scs",
            Self::Pwm => "pwm",
            Self::Pca9685 => "pca9685",
            Self::Blender => "blender",
        }
    }

    /// The kind of a name in puppet.toml.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// Whether servos on such a bus tell where they are.
    pub const fn reads(self) -> bool {
        matches!(self, Self::Dynamixel | Self::Dynamixel1 | Self::Sts | Self::Scs)
    }
}

/// Most buses of a puppet.
pub const MAX_BUSES: usize = 4;

/// A bus of a puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusSpec {
    /// What it speaks.
    pub kind: BusKind,
    /// Bits per second, not 0; for PWM the pulses per second. For a PCA9685 the pulses per second or, from
    /// [`OSCILLATORS`] on, the hertz of its oscillator, with which it gives [`PCA9685_HZ`].
    pub baud: u32,
}

/// Pulses per second that a PCA9685 gives.
pub const PCA9685_HZ: u32 = 50;

/// Hertz that the oscillator of a PCA9685 may have to give [`PCA9685_HZ`].
pub const OSCILLATORS: RangeInclusive<u32> = 3_000_000..=50_000_000;

impl BusSpec {
    /// A PCA9685 that gives so many pulses per second, with its oscillator's hertz. At [`PCA9685_HZ`] the oscillator is
    /// what is kept.
    #[must_use]
    pub const fn pca9685(pulses_hz: u32, oscillator_hz: u32) -> Self {
        let baud = if pulses_hz == PCA9685_HZ { oscillator_hz } else { pulses_hz };
        Self { kind: BusKind::Pca9685, baud }
    }

    /// The hertz of its oscillator, where it has one and the puppet says them.
    #[must_use]
    pub const fn oscillator_hz(self) -> Option<u32> {
        let says = matches!(self.kind, BusKind::Pca9685) && self.baud >= *OSCILLATORS.start();
        if says { Some(self.baud) } else { None }
    }

    /// Bits per second, or pulses per second.
    #[must_use]
    pub const fn rate(self) -> u32 {
        if self.oscillator_hz().is_some() { PCA9685_HZ } else { self.baud }
    }
}
