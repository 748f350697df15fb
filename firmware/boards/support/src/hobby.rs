//! Hobby servos beside the servo bus: on a PCA9685, and on the controller's own PWM pins.

use core::convert::Infallible;
use embassy_time::Delay;
use embedded_hal::pwm::{self, SetDutyCycle};
use embedded_hal_async::i2c::{self, I2c};
use firmware::bus::{BoardBuses, PuppetBus};
use firmware::map::{BusKind, JointMap, MAX_SERVOS};
use servo_wire::bus::ServoBus;
use servo_wire::pca9685::{CHANNELS, DEFAULT_ADDRESS, OSCILLATOR_HZ, Pca9685Bus};
use servo_wire::pwm::{Calibration, Channel, PwmBus, PwmTiming};

/// What a board has for hobby servos; `None` where its puppet has none.
pub struct Hobby<I, P, const N: usize> {
    /// The I2C bus with a PCA9685 at its address 0x40.
    pub i2c: Option<I>,
    /// Channels that run with this timing.
    pub pwm: Option<([P; N], PwmTiming)>,
}

/// An I2C bus or a PWM channel that a board has not.
pub enum Nothing {}

impl i2c::ErrorType for Nothing {
    type Error = Infallible;
}

impl I2c for Nothing {
    async fn transaction(&mut self, _: u8, _: &mut [i2c::Operation<'_>]) -> Result<(), Infallible> {
        match *self {}
    }
}

impl pwm::ErrorType for Nothing {
    type Error = Infallible;
}

impl SetDutyCycle for Nothing {
    fn max_duty_cycle(&self) -> u16 {
        match *self {}
    }

    fn set_duty_cycle(&mut self, _: u16) -> Result<(), Infallible> {
        match *self {}
    }
}

impl Hobby<Nothing, Nothing, 0> {
    /// A board without hobby servos.
    pub const NONE: Self = Self { i2c: None, pwm: None };
}

/// The servo bus of a puppet with hobby servos.
pub type MixedBus<S, I, P, const N: usize> = PuppetBus<S, Pca9685Bus<I, Delay>, PwmBus<P, N>>;

impl<I: I2c, P: SetDutyCycle, const N: usize> Hobby<I, P, N> {
    /// The buses of the map, those of Dynamixel servos on `serial`. Panics where one is not there.
    pub(crate) fn with<S: ServoBus>(self, map: &JointMap<MAX_SERVOS>, serial: S) -> MixedBus<S, I, P, N> {
        let Self { i2c, pwm } = self;
        let calibrations = [Calibration::WIDE; CHANNELS];
        // The address is that which the chip comes with, and so is the oscillator unless the puppet says another one.
        let oscillator = map.oscillator_hz().unwrap_or(OSCILLATOR_HZ);
        let pca9685 =
            i2c.and_then(|i2c| Pca9685Bus::at(i2c, DEFAULT_ADDRESS, Delay, oscillator, calibrations).ok());
        let pwm = pwm.map(|(pins, timing)| {
            PwmBus::new(pins.map(|pin| Channel::new(pin, Calibration::WIDE)), timing.period_us)
        });
        let board = BoardBuses { serial: Some((BusKind::Dynamixel, serial)), pca9685, pwm };
        match board.of_map(map) {
            Ok(bus) => bus,
            Err(error) => defmt::panic!("map: {}", error),
        }
    }
}
