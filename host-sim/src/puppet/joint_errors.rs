//! How far a puppet's joints are from what they were to do, when a clip plays.
//!
//! Measured on the puppet's ticks, as the player goes through a clip: interpolated between frames, kept within range, speed and
//! acceleration, and rounded to whole goals. Values are in the unit of each joint's channel: degrees, or centimetres of a joint
//! that slides.

use super::rehearse::{Worst, each_tick, per_fine_goal, start};
use anyhow::Result;
use decoder_core::{Error, I16F16};
use firmware::frames::Frames;
use firmware::limits::FINE_BITS;
use mocap::Motion;
use puppet_file::Map;
use serde::Serialize;

/// A joint in one clip.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointError {
    /// Lowest and highest value that was asked for; of a clip alone, the clip's own.
    pub asked: [f64; 2],
    /// The same of the clip.
    pub clip: [f64; 2],
    /// The same of what the servo is told.
    pub played: [f64; 2],
    /// Root of the mean squared difference of what the servo is told from what was asked for.
    pub rms: f64,
    /// The largest difference.
    pub worst: Worst,
    /// Root of the mean squared difference of the clip alone from what was asked for, before limits and rounding.
    pub clip_rms: f64,
    /// The largest difference of the clip alone.
    pub clip_worst: f64,
}

impl JointError {
    /// Whether the servo is told the same goal from the first tick to the last.
    pub fn stands_still(&self) -> bool {
        self.played[0] == self.played[1]
    }
}

/// How large the errors of each joint may be, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointBounds {
    /// Root of the mean squared difference.
    pub rms: f64,
    /// The largest difference.
    pub worst: f64,
}

impl JointBounds {
    /// How many times what they may be the errors of a joint are: at most 1 where they are within.
    pub fn excess(&self, joint: &JointError) -> f64 {
        self.of(joint.rms, joint.worst.value)
    }

    /// How many times what it may be a clip's part in the errors of a joint is, where the recording itself, played without loss,
    /// has the errors `least`. A joint that its limits alone keep beyond the bounds is no reason for a coarse clip: then the clip
    /// itself is to be within them, and what the joint makes of it no further beyond `least`.
    pub fn excess_of_clip(&self, joint: &JointError, least: &JointError) -> f64 {
        if self.excess(least) <= 1.0 {
            return self.excess(joint);
        }
        let (rms, worst) = (joint.rms - least.rms, joint.worst.value - least.worst.value);
        self.of(joint.clip_rms, joint.clip_worst).max(self.of(rms, worst))
    }

    fn of(&self, rms: f64, worst: f64) -> f64 {
        (rms / self.rms).max(worst / self.worst)
    }
}

/// What the joints of a puppet are to do.
pub struct Asked<'m> {
    map: &'m Map,
    /// For each tick where every joint is to be, as fine goals.
    goals: Vec<i32>,
}

impl<'m> Asked<'m> {
    /// What frames ask for.
    ///
    /// # Errors
    /// Where frames and map do not fit together, or the clip is damaged.
    pub fn of(frames: &mut dyn Frames, map: &'m Map) -> Result<Self> {
        let mut goals = Vec::new();
        each_tick(frames, map, |_, wanted| goals.extend_from_slice(wanted))?;
        Ok(Self { map, goals })
    }

    /// How far the joints are from it when these frames play, in the order of the map.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn errors(&self, frames: &mut dyn Frames) -> Result<Vec<JointError>> {
        let joints = self.map.joints();
        let mut courses = vec![Course::default(); joints.len()];
        let mut asked = self.goals.chunks_exact(joints.len());
        let mut last: Option<&[i32]> = None;
        each_tick(frames, self.map, |seconds, wanted| {
            // Clips of one motion have as many ticks; a longer one is held against the last.
            let Some(asked) = asked.next().or(last) else { return };
            last = Some(asked);
            for (index, course) in courses.iter_mut().enumerate() {
                let joint = &joints[index];
                let limits = joint.limits();
                let limiter = course.limiter.get_or_insert_with(|| start(&limits, wanted[index]));
                limiter.follow(&limits, wanted[index]);
                let played = limiter.goal() << FINE_BITS;
                course.see(asked[index], wanted[index], played, seconds, per_fine_goal(joint));
            }
        })?;
        let value = |index: usize, goal: i32| {
            let joint = &joints[index];
            let zero = f64::from(joint.zero) * f64::from(1 << FINE_BITS);
            (f64::from(goal) - zero) * per_fine_goal(joint) * joint.scale.to_num::<f64>().signum()
        };
        let range = |index: usize, [low, high]: [i32; 2]| {
            let (one, other) = (value(index, low), value(index, high));
            [one.min(other), one.max(other)]
        };
        let errors = courses.into_iter().enumerate().map(|(index, course)| JointError {
            asked: range(index, course.asked),
            clip: range(index, course.clip),
            played: range(index, course.played),
            rms: (course.squares / course.ticks).sqrt(),
            worst: course.worst,
            clip_rms: (course.clip_squares / course.ticks).sqrt(),
            clip_worst: course.clip_worst,
        });
        Ok(errors.collect())
    }
}

/// A joint on its way through a clip. Ranges are fine goals.
#[derive(Clone)]
struct Course {
    limiter: Option<firmware::limits::Limiter>,
    ticks: f64,
    asked: [i32; 2],
    clip: [i32; 2],
    played: [i32; 2],
    squares: f64,
    worst: Worst,
    clip_squares: f64,
    clip_worst: f64,
}

impl Default for Course {
    fn default() -> Self {
        let none = [i32::MAX, i32::MIN];
        Self {
            limiter: None,
            ticks: 0.0,
            asked: none,
            clip: none,
            played: none,
            squares: 0.0,
            worst: Worst::default(),
            clip_squares: 0.0,
            clip_worst: 0.0,
        }
    }
}

impl Course {
    fn see(&mut self, asked: i32, clip: i32, played: i32, seconds: f64, unit: f64) {
        self.ticks += 1.0;
        for (range, goal) in [(&mut self.asked, asked), (&mut self.clip, clip), (&mut self.played, played)] {
            *range = [range[0].min(goal), range[1].max(goal)];
        }
        let off = |goal: i32| (f64::from(goal) - f64::from(asked)).abs() * unit;
        self.squares += off(played).powi(2);
        self.worst.see(off(played), seconds);
        self.clip_squares += off(clip).powi(2);
        self.clip_worst = self.clip_worst.max(off(clip));
    }
}

/// A recorded motion as frames: what a decoder would give of a clip without loss.
pub struct Recorded<'m> {
    motion: &'m Motion,
    next: usize,
    frame: Vec<I16F16>,
}

impl<'m> Recorded<'m> {
    /// Frames of a motion whose angles are continuous.
    pub const fn new(motion: &'m Motion) -> Self {
        Self { motion, next: 0, frame: Vec::new() }
    }
}

impl Frames for Recorded<'_> {
    fn channels(&self) -> usize {
        self.motion.channels
    }

    fn frames(&self) -> u32 {
        u32::try_from(self.motion.frames()).unwrap_or(u32::MAX)
    }

    fn rate_centihertz(&self) -> u16 {
        (self.motion.fps * 100.0).round() as u16
    }

    fn position(&self) -> u32 {
        self.next as u32
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        if self.next >= self.motion.frames() {
            return Ok(None);
        }
        self.frame.clear();
        self.frame
            .extend(self.motion.frame(self.next).iter().map(|&value| I16F16::saturating_from_num(value)));
        self.next += 1;
        Ok(Some(&self.frame))
    }

    fn approach(&mut self, frame: u32) {
        self.next = self.motion.frames().min(frame as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puppet_file::Puppet;
    use std::path::Path;

    /// One elbow at 10 ticks a second, which may be off by these limits; a motion of 10 frames a second on channel 0 of the sample.
    fn errors(limits: &str, recorded: &[f64], clip: &[f64]) -> JointError {
        let text = format!(
            "servo_hz = 10\nbaud = 1\ninterpolation = 'linear'\n[[joint]]\nname = 'a'\nchannel = 'rradius.rx'\nid = 1\n{limits}\n"
        );
        let skeleton = mocap::sample::clip().skeleton;
        let map = Puppet::parse(Path::new("p.toml"), text).unwrap().map(&skeleton).unwrap();
        let motion = |values: &[f64]| Motion {
            fps: 10.0,
            channels: 31,
            samples: values.iter().flat_map(|&value| [value; 31]).collect(),
        };
        let (recorded, clip) = (motion(recorded), motion(clip));
        let asked = Asked::of(&mut Recorded::new(&recorded), &map).unwrap();
        asked.errors(&mut Recorded::new(&clip)).unwrap().remove(0)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 0.05, "{found}, expected {expected}");
    }

    const FREE: &str = "range = [-90, 90]\nmax_speed = 1000\nmax_acceleration = 100000\ndirection = -1";

    #[test]
    fn differences_are_in_the_channels_unit_whatever_the_direction() {
        let recorded = [0.0, 10.0, 20.0, 30.0, 20.0];
        let found = errors(FREE, &recorded, &recorded.map(|value| value + 2.0));
        near(found.rms, 2.0);
        near(found.worst.value, 2.0);
        let ranges = [(found.asked, [0.0, 30.0]), (found.clip, [2.0, 32.0]), (found.played, [2.0, 32.0])];
        for (found, expected) in ranges {
            near(found[0], expected[0]);
            near(found[1], expected[1]);
        }
        let bounds = JointBounds { rms: 1.0, worst: 4.0 };
        near(bounds.excess(&found), 2.0);
        assert!(!found.stands_still());
    }

    #[test]
    fn limits_are_the_players_and_not_the_clips() {
        let recorded = [0.0, 40.0, 40.0, 40.0, 40.0, 40.0];
        let found =
            errors("range = [-90, 30]\nmax_speed = 1000\nmax_acceleration = 100000", &recorded, &recorded);
        near(found.played[1], 30.0);
        near(found.worst.value, 10.0);
        near(found.rms, 10.0 * (5.0_f64 / 6.0).sqrt());
        assert_eq!((found.clip_rms, found.clip_worst), (0.0, 0.0));
        let bounds = JointBounds { rms: 1.0, worst: 2.0 };
        assert!(bounds.excess(&found) > 5.0 && bounds.excess_of_clip(&found, &found) == 0.0);
        // Where the joint can, what counts is where it is.
        let wide = JointBounds { rms: 20.0, worst: 20.0 };
        assert_eq!(wide.excess_of_clip(&found, &found), wide.excess(&found));
        let slow =
            errors("range = [-90, 90]\nmax_speed = 100\nmax_acceleration = 100000", &recorded, &recorded);
        near(slow.worst.value, 30.0);
        assert_eq!(slow.worst.seconds, 0.1);
    }

    #[test]
    fn a_servo_that_is_told_one_goal_stands_still() {
        let recorded = [5.0, 5.03, 5.0, 5.02];
        assert!(errors(FREE, &recorded, &recorded).stands_still());
        // At the end of its range all the time.
        let beyond = [40.0, 50.0, 45.0];
        assert!(errors("range = [-90, 30]\nmax_speed = 1000", &beyond, &beyond).stands_still());
    }
}
