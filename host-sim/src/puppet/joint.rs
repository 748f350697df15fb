//! A joint's entry in numbers that a device uses.

use super::file::Entry;
use super::{Channels, Mistakes, Puppet, models};
use anyhow::Result;
use decoder_core::I16F16;
use firmware::limits::{FINE_BITS, MAX_VELOCITY};
use firmware::map::{BusKind, Idle, Joint};
use toml::Spanned;

/// Seconds in which a joint reaches its highest speed, where a puppet does not say its acceleration.
const DEFAULT_RISE: f64 = 0.05;

/// Goals that a kind of servo takes: the lowest, the highest, and how many a degree is.
///
/// Sources: e-Manual, "XM430-W350" (4096 a turn) and "AX-12A" (1024 in 300°); Feetech's memory tables of the STS3215 (4096
/// a turn) and SCS15 (1024 in 200°); hobby servos take pulses of 500 to 2500 µs for some 180°.
const fn servo(kind: BusKind) -> (i32, i32, f64) {
    match kind {
        BusKind::Dynamixel | BusKind::Sts => (0, 4095, 4096.0 / 360.0),
        BusKind::Dynamixel1 => (0, 1023, 1024.0 / 300.0),
        BusKind::Scs => (0, 1023, 1024.0 / 200.0),
        BusKind::Pwm | BusKind::Pca9685 | BusKind::Blender => (500, 2500, 2000.0 / 180.0),
    }
}

/// The channel that a joint follows.
struct Channel {
    index: u16,
    /// Whether its unit is the degree, or the cm.
    turns: bool,
    /// Goal units per unit, without the direction.
    scale: f64,
}

impl Puppet {
    /// The joint, and what is wrong with its entry.
    pub(super) fn joint(
        &self,
        entry: &Entry,
        bus: u8,
        kind: BusKind,
        channels: &Channels,
        mistakes: &mut Mistakes,
    ) -> Option<Joint> {
        let (lowest, highest, per_degree) = servo(kind);
        let channel = mistakes.note(self.channel(entry, per_degree, channels));
        let sign = mistakes.note(match &entry.direction {
            None => Ok(1.0),
            Some(direction) => match *direction.get_ref() {
                sign @ (1 | -1) => Ok(f64::from(sign)),
                found => Err(self.wrong(direction, &format!("found {found}, expected 1 or -1"))),
            },
        });
        let speed = mistakes.note(self.positive(&entry.max_speed, f64::MAX));
        let acceleration = match &entry.max_acceleration {
            None => speed.map(|speed| speed / DEFAULT_RISE),
            Some(acceleration) => mistakes.note(self.positive(acceleration, f64::MAX)),
        };
        let (Channel { index, turns, scale }, sign) = (channel?, sign?);
        let unit = if turns { "degree" } else { "cm" };
        let zero = entry.zero.as_ref().map_or((lowest + highest + 1) / 2, |zero| *zero.get_ref());
        let to_goal = |value: f64| (f64::from(zero) + sign * scale * value).round();
        let range = mistakes.note(self.range(entry, zero, (lowest, highest), to_goal));
        let home = match (&entry.home, range) {
            (Some(home), Some((min, max))) => {
                let goal = to_goal(*home.get_ref());
                let why = || format!("this is goal {goal}, the range is {min} to {max}");
                mistakes
                    .note((min..=max).contains(&goal).then_some(goal).ok_or_else(|| self.wrong(home, &why())))
            }
            _ => Some(f64::from(zero)),
        };
        let hz = f64::from(*self.file.servo_hz.get_ref());
        let fine = f64::from(1 << FINE_BITS);
        let most = f64::from(MAX_VELOCITY);
        let velocity = speed.and_then(|speed| {
            let velocity = (speed * scale / hz * fine).min(most);
            let least = hz / scale / fine;
            let why = || format!("too slow for a servo at {hz} Hz, expected at least {least:.4} {unit}s/s");
            mistakes.note(
                (velocity >= 1.0).then_some(velocity).ok_or_else(|| self.wrong(&entry.max_speed, &why())),
            )
        });
        let acceleration = acceleration.map(|value| (value * scale / (hz * hz) * fine).clamp(1.0, most));
        let idle = match &entry.idle {
            Some(spanned) => {
                // Without a range that is one, the servo's own.
                let (min, max) = range.unwrap_or((f64::from(lowest), f64::from(highest)));
                let entry = *spanned.get_ref();
                let goals = |value: f64| {
                    let goals = (sign * scale * value).round();
                    let why = || format!("{value} {unit}s are more than the joint's range");
                    let fits = goals.abs() <= max - min;
                    fits.then_some(goals as i16).ok_or_else(|| self.wrong(spanned, &why()))
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
        let scale = I16F16::saturating_from_num(sign * scale);
        if scale == I16F16::ZERO {
            mistakes.add(self.wrong(&entry.name, "the scale is too small for a servo to move"));
        }
        let (min, max) = range?;
        Some(Joint {
            channel: index,
            bus,
            id: *entry.id.get_ref(),
            zero,
            home: home? as i32,
            scale,
            min: min as i32,
            max: max as i32,
            max_velocity: velocity? as i32,
            max_acceleration: acceleration? as i32,
            idle: idle?,
        })
    }

    fn channel(&self, entry: &Entry, per_degree: f64, channels: &Channels) -> Result<Channel> {
        let name = entry.channel.get_ref();
        let Some((index, turns)) = channels.find(name) else {
            return Err(self.wrong(&entry.channel, &channels.missing(name)));
        };
        let scale = match &entry.scale {
            Some(scale) => self.positive(scale, I16F16::MAX.to_num())?,
            None if turns => per_degree,
            None => {
                return Err(self.wrong(&entry.channel, "a translation needs `scale`, in goal units per cm"));
            }
        };
        let index = u16::try_from(index)
            .map_err(|_| self.wrong(&entry.channel, "a clip has at most 65535 channels"))?;
        Ok(Channel { index, turns, scale })
    }

    /// Lowest and highest goal.
    fn range(
        &self,
        entry: &Entry,
        zero: i32,
        (lowest, highest): (i32, i32),
        to_goal: impl Fn(f64) -> f64,
    ) -> Result<(f64, f64)> {
        let ([one, other], place) = match (&entry.range, &entry.goal_range) {
            (Some(range), None) => (range.get_ref().map(to_goal), range.span()),
            (None, Some(range)) => (range.get_ref().map(f64::from), range.span()),
            _ => {
                return Err(self.wrong(&entry.name, "expected either `range` or `goal_range`, and not both"));
            }
        };
        let (min, max) = (one.min(other), one.max(other));
        if !(min >= f64::from(lowest) && max <= f64::from(highest)) {
            let why = format!("these are goals {min} to {max}, a servo takes {lowest} to {highest}");
            return Err(self.wrong_at(place, &why));
        }
        if f64::from(zero) < min || f64::from(zero) > max {
            let why = format!("these are goals {min} to {max}, which must include the zero, {zero}");
            return Err(self.wrong_at(place, &why));
        }
        Ok((min, max))
    }

    /// The model number that an entry says.
    pub(super) fn model(&self, entry: &Entry) -> Result<Option<u16>> {
        let Some(spanned) = &entry.model else { return Ok(None) };
        let number = models::number(spanned.get_ref());
        number.map(Some).map_err(|why| self.wrong(spanned, &why))
    }

    fn positive(&self, value: &Spanned<f64>, highest: f64) -> Result<f64> {
        let found = *value.get_ref();
        if found > 0.0 && found <= highest {
            return Ok(found);
        }
        let most = if highest < f64::MAX { format!(" and at most {highest}") } else { String::new() };
        Err(self.wrong(value, &format!("found {found}, expected more than 0{most}")))
    }
}
