//! A joint's entry in numbers that a device uses.

use crate::channels::{Channels, Owner, Unit};
use crate::error::{Error, Mistakes, Problem};
use crate::file::JointEntry;
use crate::models;
use crate::puppet::Puppet;
use decoder_core::I16F16;
use firmware::limits::{FINE_BITS, MAX_VELOCITY};
use firmware::map::{BusKind, GOAL_LIMIT, Idle, Joint};
use toml::Spanned;

/// Seconds in which a joint reaches its highest speed, where a puppet does not say its acceleration.
const DEFAULT_RISE: f64 = 0.05;

/// What a servo makes of goals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// The lowest goal that it takes.
    pub lowest: i32,
    /// The highest goal that it takes.
    pub highest: i32,
    /// Goals in a degree.
    pub per_degree: f64,
}

impl Units {
    /// Those of the servos on a kind of bus; of the servo with this model number, where it differs from them.
    ///
    /// Sources: e-Manual, "XM430-W350" (4096 a turn), "AX-12A" (1024 in 300°) and "MX-28" (4096 a turn); Feetech's
    /// memory tables of the STS3215 (4096 a turn) and SCS15 (1024 in 200°) and its data sheet of the SCS0009 (1024 in
    /// 300°); hobby servos take pulses of 500 to 2500 µs for some 180°.
    #[must_use]
    pub const fn of(kind: BusKind, model: Option<u16>) -> Self {
        let (lowest, highest, per_degree) = match (kind, model) {
            (BusKind::Dynamixel | BusKind::Sts, _) => (0, 4095, 4096.0 / 360.0),
            (BusKind::Dynamixel1, Some(models::MX_12W | models::MX_28 | models::MX_64 | models::MX_106)) => {
                (0, 4095, 4096.0 / 360.0)
            }
            (BusKind::Dynamixel1, _) | (BusKind::Scs, Some(models::SCS0009)) => (0, 1023, 1024.0 / 300.0),
            (BusKind::Scs, _) => (0, 1023, 1024.0 / 200.0),
            (BusKind::Pwm | BusKind::Pca9685 | BusKind::Blender, _) => (500, 2500, 2000.0 / 180.0),
        };
        Self { lowest, highest, per_degree }
    }

    /// The goal in the middle.
    #[must_use]
    pub const fn middle(self) -> i32 {
        (self.lowest + self.highest + 1) / 2
    }
}

/// The channel that a joint follows in a clip.
struct Channel {
    index: u16,
    unit: Unit,
    /// Goal units per unit, without the direction.
    scale: f64,
    /// What is still to be added to its values to get those of the joint.
    offset: f64,
}

impl Puppet {
    /// The joint, and what is wrong with its entry.
    pub(crate) fn joint(
        &self,
        entry: &JointEntry,
        bus: u8,
        kind: BusKind,
        channels: &Channels,
        mistakes: &mut Mistakes,
    ) -> Option<Joint> {
        // A model that is not known is told by whoever looks at the model.
        let units = Units::of(kind, self.model(entry).ok().flatten());
        let Units { lowest, highest, per_degree } = units;
        let channel = mistakes.note(self.channel(entry, per_degree, channels));
        let sign = mistakes.note(match &entry.direction {
            None => Ok(1.0),
            Some(direction) => match *direction.get_ref() {
                sign @ (1 | -1) => Ok(f64::from(sign)),
                found => Err(self.wrong(direction, Problem::Direction { found })),
            },
        });
        let speed = mistakes.note(self.positive(&entry.max_speed, f64::MAX));
        let acceleration = match &entry.max_acceleration {
            None => speed.map(|speed| speed / DEFAULT_RISE),
            Some(acceleration) => mistakes.note(self.positive(acceleration, f64::MAX)),
        };
        // What else is wrong is told too, as far as it does not depend on what is not known.
        let known = channel.is_some() && sign.is_some();
        let given = entry.scale.as_ref().map(|scale| *scale.get_ref()).filter(|scale| *scale > 0.0);
        let unknown =
            Channel { index: 0, unit: Unit::Degree, scale: given.unwrap_or(per_degree), offset: 0.0 };
        let (Channel { index, unit, scale, offset }, sign) =
            (channel.unwrap_or(unknown), sign.unwrap_or(1.0));
        let ends = if known { (f64::from(lowest), f64::from(highest)) } else { (f64::MIN, f64::MAX) };
        let zero = entry.zero.as_ref().map_or(units.middle(), |zero| *zero.get_ref());
        let to_goal = |value: f64| (f64::from(zero) + sign * scale * value).round();
        let range = mistakes.note(self.range(entry, ends, to_goal));
        let home = match (&entry.home, range) {
            _ if !known => Some(f64::from(zero)),
            (Some(home), Some((min, max))) => {
                let goal = to_goal(*home.get_ref());
                let fits = (min..=max).contains(&goal).then_some(goal);
                mistakes
                    .note(fits.ok_or_else(|| self.wrong(home, Problem::HomeOutOfRange { goal, min, max })))
            }
            // At value 0, or as near to it as the range lets the joint come.
            (None, Some((min, max))) => Some(f64::from(zero).clamp(min, max)),
            (_, None) => None,
        };
        let hz = f64::from(self.servo_hz());
        let fine = f64::from(1 << FINE_BITS);
        let most = f64::from(MAX_VELOCITY);
        let velocity = speed.and_then(|speed| {
            let velocity = (speed * scale / hz * fine).min(most);
            let least = hz / scale / fine;
            let fits = (velocity >= 1.0).then_some(velocity);
            let too_slow = || self.wrong(&entry.max_speed, Problem::TooSlow { hz, least, unit });
            mistakes.note(fits.ok_or_else(too_slow))
        });
        let acceleration = acceleration.and_then(|acceleration| {
            let goals = (acceleration * scale / (hz * hz) * fine).min(most);
            let least = hz * hz / scale / fine;
            // Only what the file says can be wrong: what follows from the speed is as little as can be.
            match &entry.max_acceleration {
                Some(given) if goals < 1.0 => {
                    mistakes.add(self.wrong(given, Problem::TooGentle { hz, least, unit }));
                    None
                }
                _ => Some(goals.max(1.0)),
            }
        });
        let idle = match &entry.idle {
            Some(spanned) => {
                // Without a range that is one, the servo's own.
                let (min, max) = range.unwrap_or((f64::from(lowest), f64::from(highest)));
                let entry = *spanned.get_ref();
                let goals = |value: f64| {
                    let goals = (sign * scale * value).round();
                    let fits = (goals.abs() <= max - min).then_some(goals as i16);
                    let beyond = || self.wrong(spanned, Problem::IdleBeyondRange { found: value, unit });
                    fits.ok_or_else(beyond)
                };
                let idle = || {
                    let (breathing, sway, gaze) =
                        (goals(entry.breathing)?, goals(entry.sway)?, goals(entry.gaze)?);
                    Ok(Idle { breathing, sway, gaze })
                };
                mistakes.note(idle())
            }
            None => Some(Idle::default()),
        };
        let zero = mistakes.note(self.zero(entry, (f64::from(zero) + sign * scale * offset).round()));
        let scale = I16F16::saturating_from_num(sign * scale);
        if scale == I16F16::ZERO {
            mistakes.add(self.wrong(&entry.name, Problem::ScaleZero));
        }
        let (min, max) = range?;
        Some(Joint {
            channel: index,
            bus,
            id: *entry.id.get_ref(),
            zero: zero?,
            home: home? as i32,
            scale,
            min: min as i32,
            max: max as i32,
            max_velocity: velocity? as i32,
            max_acceleration: acceleration? as i32,
            idle: idle?,
        })
    }

    fn channel(&self, entry: &JointEntry, per_degree: f64, channels: &Channels) -> Result<Channel, Error> {
        let offset = self.offset(entry)?;
        let place = entry.channel.as_ref().unwrap_or(&entry.name);
        let own = self.own_channel(entry)?.0;
        // The puppet's own are as they should be, also where two of its joints have one name.
        let fits = channels.owner() == Owner::Puppet || channels.may_be_fitted();
        let fitted = if fits { channels.find(&own).ok() } else { None };
        let ((index, unit), offset) = match (fitted, &entry.channel) {
            // Its values are those of the joint already.
            (Some(found), _) => (found, 0.0),
            (None, Some(name)) => {
                let found = channels.find(name.get_ref());
                (found.map_err(|missing| self.wrong(name, missing))?, offset)
            }
            (None, None) => return Err(self.wrong(&entry.name, Problem::NotFitted)),
        };
        let scale = match &entry.scale {
            Some(scale) => self.positive(scale, I16F16::MAX.to_num())?,
            None if unit == Unit::Degree => per_degree,
            None => return Err(self.wrong(place, Problem::NoScale)),
        };
        let index = u16::try_from(index).map_err(|_| self.wrong(place, Problem::ChannelNumber))?;
        Ok(Channel { index, unit, scale, offset })
    }

    /// The goal at channel value 0, which a map must be able to hold.
    fn zero(&self, entry: &JointEntry, found: f64) -> Result<i32, Error> {
        if found.abs() <= f64::from(GOAL_LIMIT) {
            return Ok(found as i32);
        }
        let place =
            entry.zero.as_ref().map(Spanned::span).or_else(|| entry.offset.as_ref().map(Spanned::span));
        Err(self.wrong_at(place.unwrap_or_else(|| entry.name.span()), Problem::Zero { found }))
    }

    /// Lowest and highest goal.
    fn range(
        &self,
        entry: &JointEntry,
        (lowest, highest): (f64, f64),
        to_goal: impl Fn(f64) -> f64,
    ) -> Result<(f64, f64), Error> {
        let (goals, place): (Vec<f64>, _) = match (&entry.range, &entry.goal_range) {
            (Some(range), None) => (range.get_ref().iter().copied().map(to_goal).collect(), range.span()),
            (None, Some(range)) => (range.get_ref().iter().copied().map(f64::from).collect(), range.span()),
            _ => return Err(self.wrong(&entry.name, Problem::Ranges)),
        };
        let &[one, other] = goals.as_slice() else {
            return Err(self.wrong_at(place, Problem::RangeLength { found: goals.len() }));
        };
        if let Some(&found) = goals.iter().find(|goal| !goal.is_finite()) {
            return Err(self.wrong_at(place, Problem::NotFinite { found }));
        }
        let (min, max) = (one.min(other), one.max(other));
        if min == max {
            let found = entry.range.as_ref().and_then(|range| range.get_ref().first().copied());
            return Err(self.wrong_at(place, Problem::EmptyRange { found: found.unwrap_or(min) }));
        }
        if !(min >= lowest && max <= highest) {
            return Err(self.wrong_at(place, Problem::RangeBeyondServo { min, max, lowest, highest }));
        }
        Ok((min, max))
    }

    fn positive(&self, value: &Spanned<f64>, highest: f64) -> Result<f64, Error> {
        let found = *value.get_ref();
        if found > 0.0 && found <= highest {
            return Ok(found);
        }
        let most = (highest < f64::MAX).then_some(highest);
        Err(self.wrong(value, Problem::NotPositive { found, most }))
    }
}
