//! What holds for the whole puppet.

use crate::numbered::numbered;
use serde::{Deserialize, Serialize};

numbered! {
    /// How channels are interpolated between frames.
    #[derive(Default)]
    pub enum Interpolation {
        /// On straight lines.
        Linear = 0,
        /// On Catmull-Rom curves.
        #[default]
        CatmullRom = 1,
    }
}

numbered! {
    /// What the puppet does after a fault, until it is acknowledged.
    #[derive(Default)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    pub enum Policy {
        /// Brakes and holds the pose.
        #[default]
        Hold = 0,
        /// Brakes, then goes to the home pose slowly.
        EaseHome = 1,
        /// Lets go of all servos. A standing puppet falls.
        TorqueOff = 2,
    }
}

/// What holds for the whole puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Goals per second and servo, 1 to [`MAX_TICK_HZ`](crate::clock::MAX_TICK_HZ).
    pub tick_hz: u16,
    /// Between frames.
    pub interpolation: Interpolation,
    /// After a fault.
    pub policy: Policy,
    /// Shortest time in ms in which the puppet is brought to a pose: to a clip's first one, home, back after a fault.
    pub ease_millis: u16,
    /// Highest velocity on such a way, in 1/256 of the servo's `max_velocity`, 1 to 256.
    pub ease_velocity: u16,
    /// Time in ms over which one clip fades into the next.
    pub fade_millis: u16,
    /// Temperature in °C at which a servo is too hot; 0: what the servo itself says alone counts.
    pub temperature_limit: u8,
    /// Supply in mV below which a fault is reported; 0: not looked at.
    pub min_millivolts: u16,
    /// Silence in ms after which servos with a watchdog of their own stop; 0: not armed.
    pub servo_watchdog_millis: u16,
    /// Channels that clips must have, so that a clip of another skeleton is refused; 0: as many as the joints need, or
    /// more.
    pub channels: u16,
    /// Tenths of a degree that a servo may be from its goal without coming nearer, which is then a fault; 0: any.
    // Behind the rest of a map's bytes, since it came later.
    #[serde(skip)]
    pub following_tenths: u16,
}

/// The following error of a map that says nothing of it, in tenths of a degree.
pub(super) const FOLLOWING_TENTHS: u16 = 100;

impl Settings {
    /// What a puppet has that says nothing else: two seconds to ease at a quarter of the velocity, half a second to
    /// fade, servos that stop after 200 ms of silence, and that follow within 10 degrees.
    pub const fn new(tick_hz: u16) -> Self {
        Self {
            tick_hz,
            interpolation: Interpolation::CatmullRom,
            policy: Policy::Hold,
            ease_millis: 2000,
            ease_velocity: 64,
            fade_millis: 500,
            temperature_limit: 70,
            min_millivolts: 0,
            servo_watchdog_millis: 200,
            channels: 0,
            following_tenths: FOLLOWING_TENTHS,
        }
    }

    /// Ticks over which one clip fades into the next.
    pub const fn fade_ticks(&self) -> u32 {
        self.ticks(self.fade_millis)
    }

    /// Ticks in `millis`, rounded up.
    pub const fn ticks(&self, millis: u16) -> u32 {
        (millis as u32).wrapping_mul(self.tick_hz as u32).div_ceil(1000)
    }
}
