//! Hobby servos on PWM channels as a [`ServoBus`]: a pulse of 500 to 2500 µs, 50 times a second.
//!
//! Goal units are microseconds of pulse. A servo is driven from its first goal on and only while its torque is on;
//! else its line stays low, and it is limp. Nothing can be read back.

use crate::bus::{BusError, Goal, ServoBus};
use embedded_hal::pwm::SetDutyCycle;

/// Counts per second of a timer whose pulses are as long as they are told to the microsecond, and whose period fits
/// 16 bits.
pub const COUNTS_HZ: u32 = 2_500_000;

/// How a timer that counts [`COUNTS_HZ`] gives a number of pulses a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PwmTiming {
    /// Its greatest duty, and the count after which it starts again.
    pub top: u16,
    /// Its period in microseconds.
    pub period_us: u16,
}

impl PwmTiming {
    /// For this many pulses a second: 40 to 400, which are so far apart that the longest pulse fits.
    #[allow(clippy::arithmetic_side_effects, reason = "the rate is at least 40")]
    pub const fn of(hz: u32) -> Option<Self> {
        if hz < 40 || hz > 400 {
            return None;
        }
        Some(Self { top: (COUNTS_HZ / hz) as u16, period_us: (1_000_000 / hz) as u16 })
    }

    /// How long a pulse of so many counts is, in tenths of a microsecond.
    pub const fn tenths_us(counts: u16) -> u32 {
        (counts as u32).saturating_mul(10_000_000 / COUNTS_HZ)
    }
}

/// How a servo answers to pulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calibration {
    /// Shortest pulse in microseconds that the servo may get.
    pub min_us: u16,
    /// Longest pulse in microseconds, at least `min_us`.
    pub max_us: u16,
    /// Added to each goal, in microseconds: the horn sits on a spline and is rarely where it should be.
    pub trim_us: i16,
}

impl Calibration {
    /// What most servos take: 500 to 2500 µs, no trim.
    pub const WIDE: Self = Self { min_us: 500, max_us: 2500, trim_us: 0 };

    /// The pulse for a goal.
    #[must_use]
    pub fn pulse_us(&self, position: i32) -> u16 {
        let pulse = position.saturating_add(self.trim_us.into());
        pulse.min(self.max_us.into()).max(self.min_us.into()) as u16
    }
}

impl Default for Calibration {
    fn default() -> Self {
        Self::WIDE
    }
}

/// What a servo without feedback was told last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HobbyCommand {
    /// The pulse of its goal.
    goal_us: Option<u16>,
    torque: bool,
}

impl HobbyCommand {
    pub(crate) const fn set_goal(&mut self, pulse_us: u16) {
        self.goal_us = Some(pulse_us);
    }

    pub(crate) const fn set_torque(&mut self, on: bool) {
        self.torque = on;
    }

    /// Length of the pulse that the servo gets, in microseconds; 0 is none.
    pub(crate) fn pulse_us(&self) -> u16 {
        self.goal_us.filter(|_| self.torque).unwrap_or(0)
    }
}

/// The channel of the servo in this place: its id.
pub(crate) fn channel_of(ids: &[u8], index: usize) -> Option<usize> {
    ids.get(index).copied().map(usize::from)
}

/// One servo on a PWM channel.
#[derive(Debug)]
pub struct Channel<P> {
    pin: P,
    calibration: Calibration,
    command: HobbyCommand,
}

impl<P: SetDutyCycle> Channel<P> {
    /// A servo on a channel that runs already.
    pub const fn new(pin: P, calibration: Calibration) -> Self {
        Self { pin, calibration, command: HobbyCommand { goal_us: None, torque: false } }
    }

    fn output(&mut self, period_us: u16) -> Result<(), BusError> {
        let result = match self.command.pulse_us() {
            0 => self.pin.set_duty_cycle_fully_off(),
            pulse => self.pin.set_duty_cycle_fraction(pulse.min(period_us), period_us.max(1)),
        };
        result.map_err(|_| BusError::Port)
    }
}

/// Up to `N` hobby servos, a PWM channel each; a servo's id is the number of its channel.
#[derive(Debug)]
pub struct PwmBus<P, const N: usize> {
    channels: [Channel<P>; N],
    period_us: u16,
}

impl<P: SetDutyCycle, const N: usize> PwmBus<P, N> {
    /// Servos on channels that all run with this period in microseconds: 20,000 for 50 Hz.
    pub const fn new(channels: [Channel<P>; N], period_us: u16) -> Self {
        Self { channels, period_us }
    }
}

impl<P: SetDutyCycle, const N: usize> ServoBus for PwmBus<P, N> {
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        channel_of(ids, index).filter(|&channel| channel < N).map(drop).ok_or(BusError::TooMany)
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let channel = channel_of(ids, index).and_then(|channel| self.channels.get_mut(channel));
        let channel = channel.ok_or(BusError::TooMany)?;
        channel.command.set_torque(on);
        channel.output(self.period_us)
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let mut result = Ok(());
        for goal in goals {
            let Some(channel) = self.channels.get_mut(usize::from(goal.id)) else {
                result = result.and(Err(BusError::TooMany));
                continue;
            };
            channel.command.set_goal(channel.calibration.pulse_us(goal.position));
            result = result.and(channel.output(self.period_us));
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_futures::block_on;
    use embedded_hal::pwm::{ErrorKind, ErrorType};

    /// A channel of 0 to 40,000 counts, half a microsecond each at 50 Hz.
    #[derive(Default)]
    struct Pin {
        duty: Option<u16>,
        broken: bool,
    }

    impl ErrorType for Pin {
        type Error = ErrorKind;
    }

    impl SetDutyCycle for Pin {
        fn max_duty_cycle(&self) -> u16 {
            40_000
        }

        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), ErrorKind> {
            self.duty = Some(duty);
            if self.broken { Err(ErrorKind::Other) } else { Ok(()) }
        }
    }

    fn goals(positions: [i32; 2]) -> [Goal; 2] {
        let [first, second] = positions;
        // In another order than the channels.
        [Goal { id: 1, position: second }, Goal { id: 0, position: first }]
    }

    const IDS: [u8; 3] = [1, 0, 2];

    #[test]
    fn a_pulse_comes_with_torque_and_a_goal_only() {
        let mut pins = [Pin::default(), Pin::default()];
        let [first, second] = &mut pins;
        let trimmed = Calibration { min_us: 900, max_us: 2100, trim_us: -20 };
        let mut bus =
            PwmBus::new([Channel::new(first, Calibration::WIDE), Channel::new(second, trimmed)], 20_000);
        let duty = |bus: &PwmBus<&mut Pin, 2>| bus.channels.each_ref().map(|channel| channel.pin.duty);
        block_on(bus.set_torque(&IDS, 1, true)).unwrap();
        assert_eq!(duty(&bus), [Some(0), None]);
        block_on(bus.write_goals(&goals([1500, 1500]))).unwrap();
        assert_eq!(duty(&bus), [Some(3000), Some(0)]);
        block_on(bus.set_torque(&IDS, 0, true)).unwrap();
        assert_eq!(duty(&bus), [Some(3000), Some(2960)]);
        for (positions, expected) in [
            ([i32::MIN, i32::MIN], [1000, 1800]),
            ([i32::MAX, i32::MAX], [5000, 4200]),
            ([500, 2120], [1000, 4200]),
            ([501, 2119], [1002, 4198]),
        ] {
            block_on(bus.write_goals(&goals(positions))).unwrap();
            assert_eq!(duty(&bus), expected.map(Some));
        }
        block_on(bus.set_torque(&IDS, 1, false)).unwrap();
        block_on(bus.write_goals(&goals([1500, 1500]))).unwrap();
        assert_eq!(duty(&bus), [Some(0), Some(2960)]);
        for index in [2, 3] {
            assert_eq!(block_on(bus.set_torque(&IDS, index, true)), Err(BusError::TooMany));
            assert_eq!(block_on(bus.ping(&IDS, index)), Err(BusError::TooMany));
        }
        assert_eq!(block_on(bus.write_goals(&[Goal { id: 2, position: 1500 }])), Err(BusError::TooMany));
    }

    #[test]
    fn a_timer_gives_pulses_to_the_microsecond() {
        assert_eq!(PwmTiming::of(50), Some(PwmTiming { top: 50_000, period_us: 20_000 }));
        assert!(PwmTiming::of(39).is_none() && PwmTiming::of(401).is_none());
        for hz in [40, 50, 60, 100, 333, 400] {
            let PwmTiming { top, period_us } = PwmTiming::of(hz).unwrap();
            for pulse in 500..=2500u32 {
                // As `set_duty_cycle_fraction` does.
                let counts = pulse * u32::from(top) / u32::from(period_us);
                let tenths = PwmTiming::tenths_us(counts as u16);
                assert!(tenths.abs_diff(pulse * 10) <= 10, "{hz} Hz: {pulse} µs are {tenths} tenths");
                assert!(hz != 50 || tenths.abs_diff(pulse * 10) < 4, "{pulse}");
            }
        }
    }

    #[test]
    fn a_channel_that_fails_leaves_the_others_driven() {
        let pins = [Pin { duty: None, broken: true }, Pin::default()];
        let mut bus = PwmBus::new(pins.map(|pin| Channel::new(pin, Calibration::default())), 20_000);
        assert_eq!(block_on(bus.set_torque(&IDS, 1, true)), Err(BusError::Port));
        block_on(bus.set_torque(&IDS, 0, true)).unwrap();
        assert_eq!(block_on(bus.write_goals(&goals([1000, 2000]))), Err(BusError::Port));
        assert_eq!(bus.channels[1].pin.duty, Some(4000));
        let mut readings = [None; 2];
        assert_eq!(block_on(bus.read_all(&[1, 2], &mut readings)), Ok(()));
        assert!(!bus.reads(0));
    }
}
