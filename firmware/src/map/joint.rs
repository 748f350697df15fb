//! A servo and the channel that it follows.

use crate::limits::{FINE_BITS, Limits, clamp};
use decoder_core::I16F16;
use serde::{Deserialize, Serialize};

/// Goals stay within ± this many goal units (256 turns of a Dynamixel X), so that fine ones fit an i32.
pub const GOAL_LIMIT: i32 = (1 << 20) - 1;

/// What the procedural idle layer adds to a joint at most, in goal units; negative reverses it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Idle {
    /// With each breath.
    pub breathing: i16,
    /// In slow shifts of weight.
    pub sway: i16,
    /// Looking about.
    pub gaze: i16,
}

/// A servo and the channel that it follows. Positions are goal units: for Dynamixel X, 4096 a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Joint {
    /// Column of the clip's frames.
    pub channel: u16,
    /// Number of its bus in the map. Joints are in the order of their buses.
    pub bus: u8,
    /// The servo's id on the bus, 0 to [`MAX_ID`](servo_wire::dynamixel::MAX_ID).
    pub id: u8,
    /// Goal at channel value 0, within ±[`GOAL_LIMIT`]: the servo need not be able to go there.
    pub zero: i32,
    /// Goal at rest, within `min..=max`.
    pub home: i32,
    /// Goal units per degree, or per cm; negative reverses the direction. Not 0.
    pub scale: I16F16,
    /// Lowest goal.
    pub min: i32,
    /// Highest goal.
    pub max: i32,
    /// Largest change of the goal in one tick, in 1/1024 goal units, at least 1.
    pub max_velocity: i32,
    /// Largest change of that change from tick to tick, in 1/1024 goal units, at least 1.
    pub max_acceleration: i32,
    /// What the idle layer adds.
    pub idle: Idle,
}

impl Joint {
    /// The goal for a channel value, before limits, in 1/1024 goal units: `zero + value · scale`, rounded down.
    ///
    /// It saturates at ±2³⁰, just beyond [`GOAL_LIMIT`].
    ///
    /// Four 32-bit multiplies.
    #[inline]
    pub const fn goal(&self, value: I16F16) -> i32 {
        const MOST: i32 = (GOAL_LIMIT + 1) << FINE_BITS;
        let goal = (self.zero << FINE_BITS).saturating_add(scaled(value.to_bits(), self.scale.to_bits()));
        clamp(goal, -MOST, MOST)
    }

    /// Range, velocity and acceleration of the servo. A 64-bit divide: not for every tick.
    pub const fn limits(&self) -> Limits {
        Limits::new(self.min, self.max, self.max_velocity, self.max_acceleration)
    }
}

/// `⌊value · scale / 2²²⌋`, brought within ±2³⁰.
const fn scaled(value: i32, scale: i32) -> i32 {
    // Cores with atomics multiply to 64 bits in one instruction; those without (ARMv6-M) call a function for it.
    if cfg!(target_has_atomic = "32") { scaled_long(value, scale) } else { scaled_in_halves(value, scale) }
}

/// Product from which [`scaled`] saturates, in its high word.
const MOST_SCALED: i32 = 1 << 20;

const fn scaled_long(value: i32, scale: i32) -> i32 {
    let product = (value as i64).wrapping_mul(scale as i64);
    let high = (product >> 32) as i32;
    if high >= MOST_SCALED {
        MOST_SCALED << FINE_BITS
    } else if high < -MOST_SCALED {
        -MOST_SCALED << FINE_BITS
    } else {
        (product >> (32 - FINE_BITS)) as i32
    }
}

const fn scaled_in_halves(value: i32, scale: i32) -> i32 {
    let (value_high, value_low) = (value >> 16, value & 0xffff);
    let (scale_high, scale_low) = (scale >> 16, scale & 0xffff);
    let low = ((value_low as u32).wrapping_mul(scale_low as u32) >> 16) as i32;
    let middle = [value_high.wrapping_mul(scale_low), value_low.wrapping_mul(scale_high)];
    // In 1/65536 goal units; at most 3 · 65535.
    let below = (middle[0] & 0xffff).wrapping_add(middle[1] & 0xffff).wrapping_add(low);
    let whole = value_high
        .wrapping_mul(scale_high)
        .wrapping_add(middle[0] >> 16)
        .wrapping_add(middle[1] >> 16)
        .wrapping_add(below >> 16);
    if whole >= MOST_SCALED {
        MOST_SCALED << FINE_BITS
    } else if whole < -MOST_SCALED {
        -MOST_SCALED << FINE_BITS
    } else {
        whole << FINE_BITS | (below & 0xffff) >> (16 - FINE_BITS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const fn joint(zero: i32, scale: I16F16) -> Joint {
        let idle = Idle { breathing: 0, sway: 0, gaze: 0 };
        let (min, max) = (-GOAL_LIMIT, GOAL_LIMIT);
        Joint {
            channel: 0,
            bus: 0,
            id: 0,
            zero,
            home: zero,
            scale,
            min,
            max,
            max_velocity: 1,
            max_acceleration: 1,
            idle,
        }
    }

    fn slow(value: i32, scale: i32) -> i128 {
        let exact = (i128::from(value) * i128::from(scale)).div_euclid(1 << 22);
        exact.clamp(-(1 << 30), 1 << 30)
    }

    #[test]
    fn the_extremes_scale_exactly() {
        let values = [i32::MIN, i32::MIN + 1, -65_536, -1, 0, 1, 65_535, 65_536, i32::MAX];
        for value in values {
            for scale in values {
                assert_eq!(i128::from(scaled_long(value, scale)), slow(value, scale), "{value} · {scale}");
                assert_eq!(
                    i128::from(scaled_in_halves(value, scale)),
                    slow(value, scale),
                    "{value} · {scale}"
                );
                for zero in [-GOAL_LIMIT, GOAL_LIMIT] {
                    let joint = joint(zero, I16F16::from_bits(scale));
                    let expected = i128::from(zero << 10) + slow(value, scale);
                    let expected = expected.clamp(-(1 << 30), 1 << 30);
                    assert_eq!(i128::from(joint.goal(I16F16::from_bits(value))), expected);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn scaling_equals_the_wide_reference(value: i32, scale: i32) {
            prop_assert_eq!(i128::from(scaled_long(value, scale)), slow(value, scale));
            prop_assert_eq!(i128::from(scaled_in_halves(value, scale)), slow(value, scale));
        }
    }
}
