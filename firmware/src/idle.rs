//! Life under the clips: breathing, shifts of weight and looking about, made from formulas.
//!
//! Integers, so that every board moves alike; with the feature `micromath` the sine comes from that crate, which is
//! the cheaper one where there is a floating-point unit and differs in the last digits.

use crate::interpolate::{Fraction, least_jerk};
use crate::limits::FINE_BITS;
use crate::map;

/// Periods in ms: a breath, and two shifts of weight that never quite meet.
const BREATH_MILLIS: u32 = 4_200;
const SWAY_MILLIS: [u32; 2] = [9_700, 15_300];
/// A glance takes this long; it then rests between one and two of [`REST_MILLIS`].
const GLANCE_MILLIS: u32 = 450;
const REST_MILLIS: u32 = 1_600;
/// Time in ms for the layer to come or go.
const FADE_MILLIS: u32 = 1_000;

/// One, in the fractions of this module.
const ONE: i32 = 1 << 15;

/// The layer's state: a phase for each movement.
#[derive(Clone, Debug)]
pub struct IdleLayer {
    tick_millis_fine: u32,
    breath: u32,
    sway: [u32; 2],
    gaze: Gaze,
    /// How much of the layer there is, 0 to [`ONE`].
    gain: i32,
}

#[derive(Clone, Debug)]
struct Gaze {
    random: u32,
    from: i32,
    to: i32,
    /// In 1/256 ms, like the layer's tick.
    since: u32,
    until: u32,
}

/// What the layer adds in a tick, in ±1/32768.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IdlePose {
    breathing: i32,
    sway: i32,
    gaze: i32,
}

impl IdlePose {
    /// Whether it adds nothing to any joint.
    pub const fn is_still(&self) -> bool {
        self.breathing | self.sway | self.gaze == 0
    }

    /// What it adds to a joint with these amplitudes, in 1/1024 goal units. Any amplitudes.
    pub const fn offset(&self, idle: &map::Idle) -> i32 {
        // A product has at most 30 bits; 15 of them go, and [`FINE_BITS`] come.
        const SHIFT: u32 = 15 - FINE_BITS;
        ((idle.breathing as i32).wrapping_mul(self.breathing) >> SHIFT)
            .wrapping_add((idle.sway as i32).wrapping_mul(self.sway) >> SHIFT)
            .wrapping_add((idle.gaze as i32).wrapping_mul(self.gaze) >> SHIFT)
    }
}

impl IdleLayer {
    /// A layer at rest, for `tick_hz` ticks a second, not 0. Layers with the same `seed` look the same ways.
    pub const fn new(tick_hz: u16, seed: u32) -> Self {
        let gaze = Gaze { random: seed | 1, from: 0, to: 0, since: 0, until: REST_MILLIS << 8 };
        let tick_millis_fine = match 256_000u32.checked_div(tick_hz as u32) {
            Some(millis) => millis,
            None => 0,
        };
        Self { tick_millis_fine, breath: 0, sway: [0; 2], gaze, gain: 0 }
    }

    /// Stops at once.
    pub const fn reset(&mut self) {
        self.gain = 0;
    }

    /// Goes on by a tick; the layer comes in while `on`, and fades out otherwise.
    pub fn tick(&mut self, on: bool) -> IdlePose {
        let step = (self.tick_millis_fine.wrapping_mul(ONE as u32 / 128) / (FADE_MILLIS * 2)) as i32;
        let step = step.max(1);
        self.gain =
            if on { self.gain.wrapping_add(step).min(ONE) } else { self.gain.wrapping_sub(step).max(0) };
        if self.gain == 0 {
            return IdlePose::default();
        }
        self.breath = turn(self.breath, self.tick_millis_fine, BREATH_MILLIS);
        for (phase, millis) in self.sway.iter_mut().zip(SWAY_MILLIS) {
            *phase = turn(*phase, self.tick_millis_fine, millis);
        }
        let [one, other] = self.sway.map(sine);
        let gaze = self.gaze.tick(self.tick_millis_fine);
        let gained = |value: i32| value.wrapping_mul(self.gain) >> 15;
        IdlePose {
            breathing: gained(sine(self.breath)),
            sway: gained(one.wrapping_add(other) / 2),
            gaze: gained(gaze),
        }
    }
}

impl Gaze {
    /// Where it looks, in ±`ONE`.
    fn tick(&mut self, millis_fine: u32) -> i32 {
        self.since = self.since.wrapping_add(millis_fine);
        if self.since >= self.until {
            // Marsaglia 2003, "Xorshift RNGs".
            self.random ^= self.random << 13;
            self.random ^= self.random >> 17;
            self.random ^= self.random << 5;
            self.from = self.to;
            self.to = ((self.random & 0xffff) as i32).wrapping_sub(ONE);
            self.since = 0;
            self.until = ((GLANCE_MILLIS + REST_MILLIS) << 8)
                .wrapping_add((self.random >> 16).wrapping_mul(REST_MILLIS << 8 >> 16));
        }
        let glance = GLANCE_MILLIS << 8;
        if self.since >= glance {
            return self.to;
        }
        let path = least_jerk(Fraction::of(self.since >> 2, glance >> 2));
        self.from.wrapping_add(self.to.wrapping_sub(self.from).wrapping_mul(path.bits().into()) >> 15)
    }
}

/// A phase of 2³² a turn, after `millis_fine` / 256 ms of a period.
const fn turn(phase: u32, millis_fine: u32, period_millis: u32) -> u32 {
    match u32::MAX.checked_div(period_millis << 8) {
        Some(step) => phase.wrapping_add(millis_fine.wrapping_mul(step)),
        None => phase,
    }
}

/// `sin(2π phase / 2³²)` in ±32767/32768, within 1/4096.
#[cfg(not(feature = "micromath"))]
const fn sine(phase: u32) -> i32 {
    // A quarter turn in 1/32768, mirrored in the second and fourth quarter.
    let quarter = (phase >> 15) as i32 & 0x7fff;
    let x = if phase & 1 << 30 == 0 { quarter } else { 0x8000i32.wrapping_sub(quarter) };
    // x (1.5706 − x² (0.64278 − 0.07218 x²)), in 1/32768: the odd polynomial of degree five with the least error that is
    // 1 at 1.
    let square = x.wrapping_mul(x) >> 15;
    let rest = 21_063i32.wrapping_sub(square.wrapping_mul(2_365) >> 15);
    let positive = x.wrapping_mul(51_465i32.wrapping_sub(rest.wrapping_mul(square) >> 15)) >> 15;
    let value = if positive > 32_767 { 32_767 } else { positive };
    if phase >> 31 == 0 { value } else { value.wrapping_neg() }
}

/// `sin(2π phase / 2³²)` in ±32767/32768, within 1/512.
#[cfg(feature = "micromath")]
fn sine(phase: u32) -> i32 {
    use micromath::F32Ext;
    let turns = (phase >> 8) as f32 * (1.0 / (1 << 24) as f32);
    ((turns * core::f32::consts::TAU).sin() * 32_767.0) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sine_is_a_sine() {
        let allowed = if cfg!(feature = "micromath") { 64.0 } else { 8.0 };
        for step in 0..=40_000u32 {
            let phase = (f64::from(step) / 40_000.0 * f64::from(u32::MAX)) as u32;
            let exact = 32_768.0 * (f64::from(phase) / 2f64.powi(32) * std::f64::consts::TAU).sin();
            let found = f64::from(sine(phase));
            assert!((found - exact).abs() <= allowed, "{phase}: {found}, {exact}");
        }
    }

    /// The farthest of a movement in ten minutes, its largest step from tick to tick, and how often it came up.
    fn watch(tick_hz: u16, idle: map::Idle) -> (i32, i32, usize) {
        let mut layer = IdleLayer::new(tick_hz, 7);
        let mut last = 0;
        let (mut highest, mut step, mut rises) = (0, 0, 0);
        for _ in 0..600 * u32::from(tick_hz) {
            let offset = layer.tick(true).offset(&idle);
            highest = highest.max(offset.abs());
            step = step.max((offset - last).abs());
            rises += usize::from(last < 0 && offset >= 0);
            last = offset;
        }
        (highest, step, rises)
    }

    #[test]
    fn breaths_take_their_time_at_any_rate() {
        for tick_hz in [30, 50, 100, 1000] {
            let (highest, step, rises) = watch(tick_hz, map::Idle { breathing: 40, ..map::Idle::default() });
            assert!((40_900..=40_960).contains(&highest), "{highest}");
            assert!((141..=144).contains(&rises), "{rises} at {tick_hz} Hz");
            // 2π · 40 / 4.2 s.
            assert!(step <= 63_000 / i32::from(tick_hz) + 2, "{step}");
        }
    }

    #[test]
    fn glances_are_quick_and_without_a_jump() {
        let (highest, step, _) = watch(100, map::Idle { gaze: 100, ..map::Idle::default() });
        assert!((80 * 1024..=100 * 1024).contains(&highest), "{highest}");
        // At most 200 units in 0.45 s, 15/8 of the mean velocity at most.
        assert!(step <= 200 * 1024 * 15 / 8 / 45 + 1024, "{step}");
        let (highest, ..) = watch(100, map::Idle { sway: i16::MIN, gaze: i16::MAX, breathing: i16::MIN });
        assert!(highest <= 3 * 1024 * 32_768);
    }

    #[test]
    fn it_comes_and_goes_within_its_time() {
        let mut layer = IdleLayer::new(100, 1);
        assert_eq!(layer.tick(false), IdlePose::default());
        (0..101).for_each(|_| _ = layer.tick(true));
        assert!(layer.gain > ONE * 98 / 100, "{}", layer.gain);
        (0..103).for_each(|_| _ = layer.tick(false));
        assert_eq!(layer.tick(false), IdlePose::default());
    }
}
