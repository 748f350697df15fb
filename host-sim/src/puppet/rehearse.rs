//! What a clip asks of each joint, beside what the joint may do.

use anyhow::{Result, anyhow};
use firmware::clock::Speed;
use firmware::frames::Frames;
use firmware::limits::{FINE_BITS, Limiter, Limits};
use firmware::map::Joint;
use firmware::playback::Playback;
use puppet_file::Map;
use serde::Serialize;

/// The largest of something, and where it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Worst {
    /// How large, in degrees or cm (per second, per second squared).
    pub value: f64,
    /// When, in seconds of the clip.
    pub seconds: f64,
}

impl Worst {
    pub(super) fn see(&mut self, value: f64, seconds: f64) {
        if value > self.value {
            *self = Self { value, seconds };
        }
    }
}

/// What a clip asks of a joint, at its ticks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Demand {
    /// Beyond the range by so much at most, 0 if never.
    pub beyond_range: Worst,
    /// The first moment out of range, in seconds, and how many ticks in all.
    pub out_of_range: Option<(f64, u32)>,
    /// Highest speed, and ticks above the joint's.
    pub speed: Worst,
    /// See `speed`.
    pub too_fast: u32,
    /// Highest acceleration, and ticks above the joint's.
    pub acceleration: Worst,
    /// See `acceleration`.
    pub too_sudden: u32,
    /// How far what the limits let through is from what the clip wants, at most.
    pub off: Worst,
}

impl Demand {
    /// Whether the joint can do what the clip asks.
    pub const fn is_met(&self) -> bool {
        self.out_of_range.is_none() && self.too_fast == 0 && self.too_sudden == 0
    }
}

/// Plays the clip on the puppet's ticks, without servos.
///
/// # Errors
/// Where clip and map do not fit together, or the clip is damaged.
pub fn rehearse(frames: &mut dyn Frames, map: &Map) -> Result<Vec<Demand>> {
    let mut joints: Vec<Course> =
        map.joints().iter().map(|joint| Course::new(joint, map.tick_hz())).collect();
    each_tick(frames, map, |seconds, wanted| {
        for (course, wanted) in joints.iter_mut().zip(wanted) {
            course.tick(*wanted, seconds);
        }
    })?;
    Ok(joints.into_iter().map(|course| course.demand).collect())
}

/// Plays frames on the puppet's ticks, and tells `see` for every tick its time in seconds and where each joint is to be, as fine goals.
///
/// # Errors
/// As [`rehearse`].
pub(super) fn each_tick(frames: &mut dyn Frames, map: &Map, mut see: impl FnMut(f64, &[i32])) -> Result<()> {
    let mut playback = Playback::new(frames, map, false, 0).map_err(|(error, _)| error)?;
    let damaged = |error| anyhow!("the clip is damaged: {error}");
    while !playback.seek(map).map_err(damaged)? {}
    let mut wanted = vec![0; map.joints().len()];
    for tick in 0.. {
        playback.pose(map.settings().interpolation, &mut wanted, |to, goal| *to = goal);
        see(map.tick_micros(tick) as f64 / 1e6, &wanted);
        if playback.ended() {
            break;
        }
        playback.advance(map, Speed::NORMAL).map_err(damaged)?;
    }
    Ok(())
}

/// What a fine goal is in the unit of the joint's channel, without its direction.
pub(super) fn per_fine_goal(joint: &Joint) -> f64 {
    1.0 / (f64::from(1 << FINE_BITS) * joint.scale.to_num::<f64>().abs())
}

/// A joint before the first tick: a clip is eased into, so the joint is where the clip begins, as near as its range allows.
pub(super) fn start(limits: &Limits, wanted: i32) -> Limiter {
    Limiter::at((wanted.clamp(limits.min(), limits.max()) + (1 << (FINE_BITS - 1))) >> FINE_BITS)
}

/// A joint on its way. Positions are fine goals.
struct Course<'m> {
    joint: &'m Joint,
    hz: f64,
    last: Option<(i32, Option<i32>)>,
    limiter: Option<Limiter>,
    demand: Demand,
}

impl<'m> Course<'m> {
    const fn new(joint: &'m Joint, hz: u16) -> Self {
        let demand = Demand {
            beyond_range: NONE,
            out_of_range: None,
            speed: NONE,
            too_fast: 0,
            acceleration: NONE,
            too_sudden: 0,
            off: NONE,
        };
        Self { joint, hz: hz as f64, last: None, limiter: None, demand }
    }

    fn tick(&mut self, wanted: i32, seconds: f64) {
        let Self { joint, hz, last, limiter, demand } = self;
        let limits = joint.limits();
        let unit = per_fine_goal(joint);
        let (min, max) = (limits.min(), limits.max());
        let beyond = (min - wanted).max(wanted - max);
        if beyond > 0 {
            demand.beyond_range.see(f64::from(beyond) * unit, seconds);
            let (_, ticks) = demand.out_of_range.get_or_insert((seconds, 0));
            *ticks += 1;
        }
        let velocity = last.map(|(before, _)| wanted - before);
        if let Some(velocity) = velocity {
            demand.speed.see(f64::from(velocity.abs()) * unit * *hz, seconds);
            demand.too_fast += u32::from(velocity.abs() > joint.max_velocity);
            if let Some((_, Some(before))) = *last {
                let change = (velocity - before).abs();
                demand.acceleration.see(f64::from(change) * unit * *hz * *hz, seconds);
                demand.too_sudden += u32::from(change > joint.max_acceleration);
            }
        }
        *last = Some((wanted, velocity));
        let limiter = limiter.get_or_insert_with(|| start(&limits, wanted));
        limiter.follow(&limits, wanted);
        demand.off.see(f64::from((limiter.position() - wanted).abs()) * unit, seconds);
    }
}

const NONE: Worst = Worst { value: 0.0, seconds: 0.0 };

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::{Error, I16F16};
    use puppet_file::Puppet;
    use std::path::Path;

    /// Channel 0 of all frames, at 10 frames a second.
    struct Given(Vec<f64>, usize, [I16F16; 31]);

    impl Frames for Given {
        fn channels(&self) -> usize {
            31
        }
        fn frames(&self) -> u32 {
            self.0.len() as u32
        }
        fn rate_centihertz(&self) -> u16 {
            1000
        }
        fn position(&self) -> u32 {
            self.1 as u32
        }
        fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
            let Some(value) = self.0.get(self.1) else { return Ok(None) };
            self.1 += 1;
            self.2 = [I16F16::from_num(*value); 31];
            Ok(Some(&self.2))
        }
        fn approach(&mut self, frame: u32) {
            self.1 = frame as usize;
        }
    }

    #[test]
    fn what_a_clip_asks_is_measured_in_the_channels_unit() {
        let text = "servo_hz = 10\nbaud = 1\ninterpolation = 'linear'\n[[joint]]\nname = 'a'\nchannel = 'rradius.rx'\nid = 1\n\
                    range = [-10, 20]\nmax_speed = 50\nmax_acceleration = 1000\n";
        let map = Puppet::parse(Path::new("p.toml"), text.to_owned()).unwrap();
        let map = map.map(&mocap::sample::clip().skeleton).unwrap();
        let near = |found: Worst, value: f64, seconds: f64| {
            assert!((found.value - value).abs() < 0.05 && found.seconds == seconds, "{found:?}, not {value}");
        };
        // 10 frames a second and as many ticks: a step of 4 is 40 a second, one of 8.1 is 81.
        let mut frames = Given(vec![0.0, 4.0, 8.0, 11.9, 20.0, 28.0, 28.0], 0, [I16F16::ZERO; 31]);
        let [demand] = &rehearse(&mut frames, &map).unwrap()[..] else { panic!() };
        near(demand.beyond_range, 8.0, 0.5);
        let (first, ticks) = demand.out_of_range.unwrap();
        assert_eq!((first, ticks), (0.5, 2));
        near(demand.speed, 81.0, 0.4);
        assert_eq!((demand.too_fast, demand.too_sudden), (2, 0));
        near(demand.acceleration, 800.0, 0.6);
        near(demand.off, 8.0, 0.5);
        assert!(!demand.is_met());
        let mut calm = Given(vec![0.0, 4.0, 8.0, 8.0], 0, [I16F16::ZERO; 31]);
        let [demand] = &rehearse(&mut calm, &map).unwrap()[..] else { panic!() };
        assert!(demand.is_met() && demand.off.value < 0.1, "{demand:?}");
    }
}
