//! From the clip's rate to the servos' tick, in integers, without drift.

use crate::interpolate::Fraction;

/// Most ticks per second. A servo bus does not carry more.
pub const MAX_TICK_HZ: u16 = 1000;

/// Where a tick lies between two frames.
///
/// Counts in parts of a frame, so that both rates are exact: a tick adds the clip's rate to the phase, and a frame
/// has gone by whenever the phase reaches the tick's rate. After `k` ticks exactly `⌊k · clip / tick⌋` frames went
/// by, however large `k` is.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    phase: u32,
    clip_centihertz: u16,
    tick_centihertz: u32,
}

impl Clock {
    /// A clock at frame 0, for a clip of `clip_centihertz` hundredths of a frame per second on a bus of `tick_hz`
    /// ticks per second (1 to [`MAX_TICK_HZ`]; the joint map checks that).
    pub const fn new(clip_centihertz: u16, tick_hz: u16) -> Self {
        debug_assert!(tick_hz > 0 && tick_hz <= MAX_TICK_HZ);
        Self { phase: 0, clip_centihertz, tick_centihertz: tick_hz as u32 * 100 }
    }

    /// Goes on by one tick. [`frame_passed`](Self::frame_passed) then tells the frames that went by.
    pub const fn tick(&mut self) {
        self.phase += self.clip_centihertz as u32;
    }

    /// Whether another frame has gone by; asks until it says no, at most 656 times a tick.
    pub const fn frame_passed(&mut self) -> bool {
        if self.phase < self.tick_centihertz {
            return false;
        }
        self.phase -= self.tick_centihertz;
        true
    }

    /// How far the tick is from the frame before it to the one after it. Costs a divide.
    pub const fn fraction(&self) -> Fraction {
        Fraction::of(self.phase, self.tick_centihertz)
    }

    /// Goes to the frame itself.
    pub const fn align(&mut self) {
        self.phase = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames_after(ticks: u32, clip_centihertz: u16, tick_hz: u16) -> u64 {
        let mut clock = Clock::new(clip_centihertz, tick_hz);
        let mut frames = 0;
        for _ in 0..ticks {
            clock.tick();
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
    fn the_fraction_is_that_of_the_exact_position() {
        let mut clock = Clock::new(2_997, 50);
        for tick in 0u64..10_000 {
            let parts = tick * 2_997 % 5_000;
            assert_eq!(u64::from(clock.fraction().bits()), parts * 32_768 / 5_000, "tick {tick}");
            clock.tick();
            while clock.frame_passed() {}
        }
    }
}
