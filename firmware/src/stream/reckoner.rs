//! Concealment: dead reckoning where frames are missing, and the way back where they are there again.
//!
//! Source: the waveform-coding document, section 7.7. A channel goes on from its last position with its last velocity
//! (7-20), which decays, since a body does not move on for ever. The document leaves open how to come back without a
//! discontinuity. Here the reckoned motion, the document's ghost, goes on with what is left of its velocity while it
//! fades into the right one along the path of least jerk; so neither position nor velocity jumps.
//!
//! How fast the velocity decays and how long the fade takes was measured on recorded motion: docs/STORE.md, "Concealment".

use crate::interpolate::{Fraction, least_jerk, lerp};
use decoder_core::I16F16;

/// Time in ms in which a reckoned velocity decays to 1/e.
pub const DECAY_MILLIS: u16 = 150;

/// Time in ms over which velocities are averaged, as a time constant.
pub const AVERAGE_MILLIS: u16 = 17;

/// Time in ms of the fade back at least. After a longer loss it takes as long as that: so a body that moved away is
/// caught up with at about its own speed.
pub const EASE_MILLIS: u16 = 100;

/// How a gap is bridged, in frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reckoning {
    /// Part of the velocity that is left after a frame.
    pub keep: Fraction,
    /// Part of the newest movement in the velocity; the rest is the velocity before.
    pub newest: Fraction,
    /// Frames of the fade at least.
    pub ease: u16,
}

impl Reckoning {
    /// For motion of this rate, in hundredths of a frame per second, with these times in ms.
    pub fn new(rate_centihertz: u16, decay: u16, average: u16, ease: u16) -> Self {
        // A frame's time, and that with a time constant, both in the same unit: after a frame, whole − frame of whole is left.
        let frame = 100_000;
        let time = |millis: u16| u32::from(rate_centihertz.max(1)).saturating_mul(millis.into());
        let and = |millis: u16| time(millis).saturating_add(frame);
        let frames = u32::from(rate_centihertz).saturating_mul(ease.into()) / frame;
        Self {
            keep: part(and(decay).saturating_sub(frame), and(decay)),
            newest: part(frame, and(average)),
            ease: u16::try_from(frames.max(1)).unwrap_or(u16::MAX),
        }
    }

    /// With the times that were measured to be best.
    pub fn of(rate_centihertz: u16) -> Self {
        Self::new(rate_centihertz, DECAY_MILLIS, AVERAGE_MILLIS, EASE_MILLIS)
    }
}

/// `part / whole` to 16 bits, and below 1.
fn part(part: u32, whole: u32) -> Fraction {
    let shift = 16u32.saturating_sub(whole.leading_zeros());
    let whole = whole >> shift;
    Fraction::of((part >> shift).min(whole.saturating_sub(1)), whole)
}

/// Where a reckoner is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// Before the first frame.
    Empty,
    /// With the frames as they come.
    Right,
    /// Without frames.
    Reckoned,
    /// On the way back, so many frames of so many.
    Easing(u16, u16),
}

/// What a frame was made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Made {
    /// It is the frame that was sent.
    Right,
    /// It was made up.
    Reckoned,
    /// It is on the way from a made-up one to the right one.
    Eased,
}

/// The motion that is shown. In frames of the clip, in its channels' units.
#[derive(Debug)]
pub struct Reckoner<'s> {
    reckoning: Reckoning,
    mode: Mode,
    /// Frames that were missing, and those that were left of the fade before.
    away: u16,
    shown: &'s mut [I16F16],
    velocity: &'s mut [I16F16],
    ghost: &'s mut [I16F16],
    ghost_velocity: &'s mut [I16F16],
}

impl<'s> Reckoner<'s> {
    /// Before the first frame. `poses` has four times the memory of a frame.
    pub fn new(poses: [&'s mut [I16F16]; 4], reckoning: Reckoning) -> Self {
        let [shown, velocity, ghost, ghost_velocity] = poses;
        Self { reckoning, mode: Mode::Empty, away: 0, shown, velocity, ghost, ghost_velocity }
    }

    /// The next frame, where there is one.
    pub fn right(&mut self, frame: &[I16F16]) -> Made {
        self.mode = match self.mode {
            Mode::Empty => {
                self.velocity.fill(I16F16::ZERO);
                copy(frame, self.shown);
                Mode::Right
            }
            Mode::Right => {
                self.show(frame);
                Mode::Right
            }
            Mode::Reckoned => {
                copy(self.shown, self.ghost);
                copy(self.velocity, self.ghost_velocity);
                let all = self.away.max(self.reckoning.ease);
                self.ease(frame, 1, all)
            }
            Mode::Easing(done, all) => self.ease(frame, done.saturating_add(1), all),
        };
        if self.mode == Mode::Right { Made::Right } else { Made::Eased }
    }

    /// The next frame, where there is none.
    pub fn missing(&mut self) -> Made {
        let away = match self.mode {
            Mode::Empty | Mode::Right => 0,
            Mode::Reckoned => self.away,
            Mode::Easing(done, all) => all.saturating_sub(done),
        };
        self.away = away.saturating_add(1);
        self.mode = Mode::Reckoned;
        go_on(self.shown, self.velocity, self.reckoning.keep);
        Made::Reckoned
    }

    /// The frame that is shown.
    pub fn shown(&self) -> &[I16F16] {
        self.shown
    }

    fn show(&mut self, frame: &[I16F16]) {
        let channels = self.shown.iter_mut().zip(self.velocity.iter_mut()).zip(frame);
        for ((shown, velocity), &right) in channels {
            step(shown, velocity, right.to_bits(), self.reckoning.newest);
        }
    }

    fn ease(&mut self, frame: &[I16F16], done: u16, all: u16) -> Mode {
        if done >= all {
            self.show(frame);
            return Mode::Right;
        }
        go_on(self.ghost, self.ghost_velocity, self.reckoning.keep);
        let path = least_jerk(Fraction::of(done.into(), all.into()));
        let channels = self.shown.iter_mut().zip(self.velocity.iter_mut()).zip(frame).zip(&*self.ghost);
        for (((shown, velocity), &right), &ghost) in channels {
            let eased = lerp(ghost.to_bits(), right.to_bits(), path);
            step(shown, velocity, eased, self.reckoning.newest);
        }
        Mode::Easing(done, all)
    }
}

fn copy(from: &[I16F16], to: &mut [I16F16]) {
    to.iter_mut().zip(from).for_each(|(to, &from)| *to = from);
}

/// Shows a value, and takes in how far it is from the one before.
#[inline(always)]
fn step(shown: &mut I16F16, velocity: &mut I16F16, value: i32, newest: Fraction) {
    let movement = value.wrapping_sub(shown.to_bits());
    *velocity = I16F16::from_bits(lerp(velocity.to_bits(), movement, newest));
    *shown = I16F16::from_bits(value);
}

/// A frame of dead reckoning.
fn go_on(positions: &mut [I16F16], velocities: &mut [I16F16], keep: Fraction) {
    for (position, velocity) in positions.iter_mut().zip(velocities) {
        // Rounded towards zero, or a velocity below it would never end.
        let kept = lerp(0, velocity.saturating_abs().to_bits(), keep);
        *velocity = I16F16::from_bits(if *velocity < 0 { kept.wrapping_neg() } else { kept });
        *position = position.saturating_add(*velocity);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses(memory: &mut [I16F16]) -> [&mut [I16F16]; 4] {
        let channels = memory.len() / 4;
        let mut parts = memory.chunks_mut(channels);
        core::array::from_fn(|_| parts.next().unwrap())
    }

    fn value(number: f64) -> I16F16 {
        I16F16::from_num(number)
    }

    #[test]
    fn times_become_parts_of_frames() {
        let Reckoning { keep, newest, ease } = Reckoning::new(12000, 150, 17, 250);
        // Time constants of 18 and 2.04 frames.
        assert!((f64::from(keep.bits()) / 32768.0 - 18.0 / 19.0).abs() < 1e-4);
        assert!((f64::from(newest.bits()) / 32768.0 - 1.0 / 3.04).abs() < 1e-4);
        assert_eq!(ease, 30);
        let slow = Reckoning::new(0, 150, 0, 0);
        assert_eq!((slow.ease, slow.newest.bits()), (1, 32767));
        let fast = Reckoning::new(u16::MAX, u16::MAX, u16::MAX, u16::MAX);
        assert!(fast.keep.bits() > 32700 && fast.newest.bits() < 5);
    }

    #[test]
    fn a_steady_motion_goes_on_and_comes_to_a_stop() {
        let mut memory = [I16F16::ZERO; 8];
        let reckoning = Reckoning::new(12000, 150, 0, 100);
        let mut reckoner = Reckoner::new(poses(&mut memory), reckoning);
        for frame in 0..10 {
            assert_eq!(
                reckoner.right(&[value(f64::from(frame)), value(-2.0 * f64::from(frame))]),
                Made::Right
            );
        }
        assert_eq!(reckoner.shown(), [value(9.0), value(-18.0)]);
        // A frame later nearly the whole step, in the end 18 steps: the sum of all that is left of the velocity.
        reckoner.missing();
        assert!((reckoner.shown()[0] - value(9.0 + 18.0 / 19.0)).abs() < 0.001);
        for _ in 0..1000 {
            assert_eq!(reckoner.missing(), Made::Reckoned);
        }
        let [one, other] = [0, 1].map(|channel| reckoner.shown()[channel]);
        assert!((one - value(27.0)).abs() < 0.1 && (other - value(-54.0)).abs() < 0.2, "{one} {other}");
        let rest = reckoner.shown().to_vec();
        reckoner.missing();
        assert_eq!(reckoner.shown(), rest);
    }

    /// The largest step of a return over a distance is that of the path of least jerk, 15/8 of the mean one.
    #[test]
    fn the_way_back_has_no_step_and_ends_in_the_right_place() {
        let mut memory = [I16F16::ZERO; 4];
        let mut reckoner = Reckoner::new(poses(&mut memory), Reckoning::new(12000, 150, 17, 250));
        for _ in 0..10 {
            reckoner.right(&[value(5.0)]);
        }
        reckoner.missing();
        let (mut last, mut worst) = (reckoner.shown()[0], value(0.0));
        for frame in 1..30 {
            assert_eq!(reckoner.right(&[value(35.0)]), Made::Eased, "{frame}");
            worst = worst.max((reckoner.shown()[0] - last).abs());
            last = reckoner.shown()[0];
        }
        assert_eq!(reckoner.right(&[value(35.0)]), Made::Right);
        assert_eq!(reckoner.shown(), [value(35.0)]);
        assert!(worst < 30.0 / 30.0 * 15.0 / 8.0 + 0.01, "{worst}");
        assert!((reckoner.shown()[0] - last) < 0.02);
    }

    /// Lost again on the way back, over and over: never a step, whatever the right motion does meanwhile.
    #[test]
    fn a_loss_on_the_way_back_goes_on_from_what_is_shown() {
        let mut memory = [I16F16::ZERO; 4];
        let mut reckoner = Reckoner::new(poses(&mut memory), Reckoning::new(12000, 150, 17, 250));
        let right = |frame: i32| value(90.0 * (f64::from(frame) / 40.0).sin());
        let mut last = right(0);
        for frame in 0..2000 {
            if frame < 5 || frame * 7919 % 13 > 6 {
                reckoner.right(&[right(frame)]);
            } else {
                reckoner.missing();
            }
            let step = (reckoner.shown()[0] - last).abs();
            // The motion's own largest step is 2.25; that of a way back of the distance there can be comes on top.
            assert!(step < 2.25 + 60.0 * 15.0 / 8.0 / 30.0, "{frame}: {step}");
            last = reckoner.shown()[0];
        }
    }

    /// Values that only damage makes: nothing overflows.
    #[test]
    fn extremes_do_not_overflow() {
        let mut memory = [I16F16::ZERO; 4];
        let mut reckoner = Reckoner::new(poses(&mut memory), Reckoning::new(12000, 150, 17, 250));
        for frame in 0..500u32 {
            match frame % 7 {
                0..4 => reckoner.right(&[if frame % 2 == 0 { I16F16::MIN } else { I16F16::MAX }]),
                _ => reckoner.missing(),
            };
        }
    }
}
