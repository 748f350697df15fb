//! From the clip's rate to the servos' tick, in integers, without drift.

use crate::interpolate::Fraction;
use crate::limits::clamp;

/// Most ticks per second. A servo bus does not carry more.
pub const MAX_TICK_HZ: u16 = 1000;

/// Most frames of a clip in a tick, at the clip's own speed. A tick decodes up to four times as many at [`Speed::FASTEST`], and a
/// sixteenth more after an outside clock.
pub const MAX_FRAMES_PER_TICK: u16 = 16;

/// Whether ticks are fast enough for a clip of `clip_centihertz` hundredths of a frame per second, so that what a tick decodes is
/// bounded.
pub const fn keeps_up(clip_centihertz: u16, tick_hz: u16) -> bool {
    clip_centihertz as u32 <= (tick_hz as u32).saturating_mul(100).saturating_mul(MAX_FRAMES_PER_TICK as u32)
}

/// How fast a clip is played, in 1/256 of its own speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Speed(u16);

impl From<u16> for Speed {
    fn from(parts: u16) -> Self {
        Self::new(parts)
    }
}

impl From<Speed> for u16 {
    fn from(speed: Speed) -> Self {
        speed.0
    }
}

impl Speed {
    /// Paused.
    pub const PAUSED: Self = Self(0);
    /// As recorded.
    pub const NORMAL: Self = Self(256);
    /// A quarter of [`NORMAL`](Self::NORMAL), the lowest that a player is set to.
    pub const SLOWEST: Self = Self(64);
    /// Four times [`NORMAL`](Self::NORMAL), the highest.
    pub const FASTEST: Self = Self(1024);

    /// `parts / 256` of the recorded speed, brought between [`SLOWEST`](Self::SLOWEST) and
    /// [`FASTEST`](Self::FASTEST).
    pub const fn new(parts: u16) -> Self {
        if parts < Self::SLOWEST.0 {
            Self::SLOWEST
        } else if parts > Self::FASTEST.0 {
            Self::FASTEST
        } else {
            Self(parts)
        }
    }

    /// In 1/256.
    pub const fn parts(self) -> u16 {
        self.0
    }

    /// A step of at most `step` parts towards `target`.
    pub const fn towards(self, target: Self, step: u16) -> Self {
        if self.0 < target.0 {
            let next = self.0.saturating_add(step);
            Self(if next < target.0 { next } else { target.0 })
        } else {
            let next = self.0.saturating_sub(step);
            Self(if next > target.0 { next } else { target.0 })
        }
    }
}

/// Where a tick lies between two frames.
///
/// Counts in parts of a frame, so that both rates are exact: a tick adds the clip's rate to the phase, and a frame
/// has gone by whenever the phase reaches the tick's rate. After `k` ticks at normal speed exactly
/// `⌊k · clip / tick⌋` frames went by, however large `k` is.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// In 1/256 of a hundredth of a frame's time, below `tick_parts`, or a tick's advance above it.
    phase: u32,
    clip_centihertz: u16,
    tick_parts: u32,
    /// Parts that the clock is behind an outside one; it works them off little by little.
    behind: i32,
}

/// The part of a tick's advance by which a clock that follows another one goes faster or slower: 1/16.
const FOLLOW_SHIFT: u32 = 4;

impl Clock {
    /// A clock at frame 0, for a clip of `clip_centihertz` hundredths of a frame per second on a bus of `tick_hz`
    /// ticks per second (1 to [`MAX_TICK_HZ`]; the joint map checks that).
    pub const fn new(clip_centihertz: u16, tick_hz: u16) -> Self {
        debug_assert!(tick_hz > 0 && tick_hz <= MAX_TICK_HZ);
        Self { phase: 0, clip_centihertz, tick_parts: (tick_hz as u32).wrapping_mul(100 * 256), behind: 0 }
    }

    /// Goes on by one tick. [`frame_passed`](Self::frame_passed) then tells the frames that went by.
    pub fn tick(&mut self, speed: Speed) {
        // At most 2²⁶, and the phase before it less than 2²⁵.
        let advance = u32::from(self.clip_centihertz).wrapping_mul(speed.0.into());
        let most = (advance >> FOLLOW_SHIFT) as i32;
        let correction = clamp(self.behind, most.wrapping_neg(), most);
        self.behind = self.behind.wrapping_sub(correction);
        self.phase = self.phase.wrapping_add(advance.saturating_add_signed(correction));
    }

    /// Whether another frame has gone by; asks until it says no: for a clip that [`keeps_up`] at
    /// most 69 times a tick.
    pub const fn frame_passed(&mut self) -> bool {
        if self.phase < self.tick_parts {
            return false;
        }
        self.phase = self.phase.wrapping_sub(self.tick_parts);
        true
    }

    /// How far the tick is from the frame before it to the one after it. Costs a divide.
    pub const fn fraction(&self) -> Fraction {
        Fraction::of(self.phase >> 8, self.tick_parts >> 8)
    }

    /// Goes to the frame itself.
    pub const fn align(&mut self) {
        self.phase = 0;
    }

    /// Goes to this part of the frame, in 1/65536.
    pub const fn set_phase(&mut self, phase: u16) {
        self.phase = ((self.tick_parts as u64).wrapping_mul(phase as u64) >> 16) as u32;
    }

    /// Sets how far the clock is behind (negative: ahead of) an outside one: `frames` and `fraction` of one, in
    /// 1/65536. It then goes up to 1/16 faster or slower until that is worked off, so motion never steps.
    ///
    /// Returns false where the distance is beyond what a second can work off: the caller then rather seeks.
    pub const fn follow(&mut self, frames: i32, fraction: u16) -> bool {
        let parts = self.tick_parts as i64;
        let behind =
            (frames as i64).wrapping_mul(parts).wrapping_add((fraction as i64).wrapping_mul(parts) >> 16);
        let second = (self.clip_centihertz as i64).wrapping_mul(parts / 100) >> FOLLOW_SHIFT;
        if behind > second || behind < second.wrapping_neg() {
            return false;
        }
        self.behind = behind as i32;
        true
    }

    /// The position in the frame, in 1/65536.
    pub const fn phase(&self) -> u16 {
        match ((self.phase as u64) << 16).checked_div(self.tick_parts as u64) {
            Some(phase) => phase as u16,
            None => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames_after(ticks: u32, clip_centihertz: u16, tick_hz: u16) -> u64 {
        let mut clock = Clock::new(clip_centihertz, tick_hz);
        let mut frames = 0;
        for _ in 0..ticks {
            clock.tick(Speed::NORMAL);
            while clock.frame_passed() {
                frames += 1;
            }
        }
        frames
    }

    #[test]
    fn a_million_ticks_are_exact() {
        for (clip, tick) in [(12_000, 100), (2_997, 50), (2_398, 1000), (65_535, 1), (1, 1000), (3_000, 60)] {
            let expected = 1_000_000 * u64::from(clip) / (u64::from(tick) * 100);
            assert_eq!(frames_after(1_000_000, clip, tick), expected, "{clip} centihertz on {tick} Hz");
        }
    }

    #[test]
    fn speed_scales_the_frames_that_go_by() {
        for (parts, expected) in [(64, 300), (256, 1200), (1024, 4800), (384, 1800)] {
            let mut clock = Clock::new(12_000, 100);
            let mut frames = 0;
            for _ in 0..1000 {
                clock.tick(Speed(parts));
                while clock.frame_passed() {
                    frames += 1;
                }
            }
            assert_eq!(frames, expected);
        }
        assert_eq!([0, 100, 5000].map(|parts| Speed::new(parts).parts()), [64, 100, 1024]);
        assert_eq!(Speed::NORMAL.towards(Speed::PAUSED, 100).parts(), 156);
        assert_eq!(Speed(50).towards(Speed::PAUSED, 100), Speed::PAUSED);
        assert_eq!(Speed::PAUSED.towards(Speed::NORMAL, 300), Speed::NORMAL);
    }

    #[test]
    fn an_outside_clock_is_met_without_a_step() {
        for behind in [-3, -1, 2, 5] {
            let mut clock = Clock::new(12_000, 100);
            assert!(clock.follow(behind, 0));
            let (mut frames, mut last) = (0i64, 0);
            for tick in 1..=1000i64 {
                clock.tick(Speed::NORMAL);
                while clock.frame_passed() {
                    frames += 1;
                }
                let position = frames * 65_536 + i64::from(clock.phase());
                let step = position - last;
                last = position;
                // A tick is 1.2 frames, give or take a sixteenth.
                assert!((73_727..=83_560).contains(&step), "tick {tick}: {step}");
            }
            assert!((last - (1200 + i64::from(behind)) * 65_536).abs() <= 2, "{last}");
        }
        assert!(!Clock::new(12_000, 100).follow(8, 0));
        assert!(Clock::new(12_000, 100).follow(7, 32_768));
    }

    #[test]
    fn the_fraction_is_that_of_the_exact_position() {
        let mut clock = Clock::new(2_997, 50);
        for tick in 0u64..10_000 {
            let parts = tick * 2_997 % 5_000;
            assert_eq!(u64::from(clock.fraction().bits()), parts * 32_768 / 5_000, "tick {tick}");
            clock.tick(Speed::NORMAL);
            while clock.frame_passed() {}
        }
    }
}
