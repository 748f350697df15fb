//! What a board's pins do to hobby servos: a PCA9685 on its I2C bus, and PWM pins, and what pulses they give.

use crate::uart::ZeroDelay;
use embedded_hal::pwm::{ErrorType as PwmErrorType, SetDutyCycle};
use embedded_hal_async::i2c::{
    ErrorKind as I2cErrorKind, ErrorType as I2cErrorType, I2c, NoAcknowledgeSource, Operation,
};
use servo_wire::bus::BusError;
use servo_wire::pca9685::{CHANNELS, DEFAULT_ADDRESS, Pca9685Bus};
use servo_wire::pwm::{Calibration, Channel, PwmBus, PwmTiming};
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

/// PWM pins of a virtual board: those of a Raspberry Pi Pico's image.
pub const PWM_PINS: usize = 8;

/// Bytes of the PCA9685's registers.
const REGISTERS: usize = 256;

// Its registers (NXP, "PCA9685", section 7.3), and bits of them.
const MODE1: usize = 0x00;
const SLEEP: u8 = 1 << 4;
const AUTO_INCREMENT: u8 = 1 << 5;
const FIRST_CHANNEL: usize = 0x06;
const PRESCALE: usize = 0xFE;
const FULL_OFF: u16 = 1 << 12;

/// The pins at one moment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pins {
    registers: [u8; REGISTERS],
    /// Pulses on the PWM pins in tenths of a microsecond; 0 is none.
    tenths: [u32; PWM_PINS],
}

impl Default for Pins {
    /// As after power on: the PCA9685 sleeps.
    fn default() -> Self {
        let mut registers = [0; REGISTERS];
        registers[MODE1] = SLEEP | 1;
        registers[PRESCALE] = 0x1E;
        Self { registers, tenths: [0; PWM_PINS] }
    }
}

impl Pins {
    /// From the registers of the PCA9685, and the pulses on the PWM pins in tenths of a microsecond, 4 bytes each.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let (registers, pulses) = bytes.split_first_chunk::<REGISTERS>()?;
        let (pulses, []) = pulses.as_chunks::<4>() else { return None };
        let tenths = <&[[u8; 4]; PWM_PINS]>::try_from(pulses).ok()?.map(u32::from_le_bytes);
        Some(Self { registers: *registers, tenths })
    }

    /// The pulse on a PWM pin in microseconds, rounded; `None` where there is none, or no such pin.
    #[must_use]
    pub fn pwm_us(&self, pin: u8) -> Option<i32> {
        rounded_us(self.tenths.get(usize::from(pin)).copied()?)
    }

    /// The pulse on a channel of the PCA9685 in microseconds, rounded; `None` where there is none, or no such channel.
    /// The chip's oscillator has so many hertz.
    #[must_use]
    pub fn pca9685_us(&self, channel: u8, oscillator_hz: u32) -> Option<i32> {
        let channel = usize::from(channel);
        if channel >= CHANNELS || self.registers[MODE1] & SLEEP != 0 {
            return None;
        }
        let at = FIRST_CHANNEL + 4 * channel;
        let word = |at: usize| u16::from_le_bytes([self.registers[at], self.registers[at + 1]]);
        let (on, off) = (word(at), word(at + 2));
        let steps = u32::from((off & 0xFFF).wrapping_sub(on & 0xFFF) & 0xFFF);
        let step = u32::from(self.registers[PRESCALE]) + 1;
        if off & FULL_OFF != 0 {
            return None;
        }
        let tenths = u64::from(steps * step) * 10_000_000 / u64::from(oscillator_hz.max(1));
        rounded_us(u32::try_from(tenths).ok()?)
    }
}

/// Microseconds of so many tenths, rounded; `None` of 0.
fn rounded_us(tenths: u32) -> Option<i32> {
    (tenths > 0).then(|| ((tenths + 5) / 10) as i32)
}

/// A virtual board with hobby servos: its drivers and those who look at its pins share it.
#[derive(Clone, Default)]
pub struct HobbyBoard(Rc<RefCell<Pins>>);

impl HobbyBoard {
    /// The pins now.
    #[must_use]
    pub fn pins(&self) -> Pins {
        self.0.borrow().clone()
    }

    /// The bus of the servos on the PCA9685, whose oscillator has so many hertz.
    ///
    /// # Errors
    /// [`BusError::Unsupported`] where such an oscillator cannot give 50 pulses a second.
    pub fn pca9685(&self, oscillator_hz: u32) -> Result<Pca9685Bus<VirtualPca9685, ZeroDelay>, BusError> {
        let calibrations = [Calibration::WIDE; CHANNELS];
        let chip = VirtualPca9685(self.0.clone());
        Pca9685Bus::at(chip, DEFAULT_ADDRESS, ZeroDelay, oscillator_hz, calibrations)
    }

    /// The bus of the servos on the PWM pins, with the pulses of this timing.
    #[must_use]
    pub fn pwm(&self, timing: PwmTiming) -> PwmBus<VirtualPwmPin, PWM_PINS> {
        let pin = |channel| VirtualPwmPin { board: self.0.clone(), channel, top: timing.top };
        let channels = std::array::from_fn(|channel| Channel::new(pin(channel), Calibration::WIDE));
        PwmBus::new(channels, timing.period_us)
    }
}

/// The PCA9685 on an I2C bus.
pub struct VirtualPca9685(Rc<RefCell<Pins>>);

impl I2cErrorType for VirtualPca9685 {
    type Error = I2cErrorKind;
}

impl I2c for VirtualPca9685 {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), I2cErrorKind> {
        if address != DEFAULT_ADDRESS {
            return Err(I2cErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
        }
        let registers = &mut self.0.borrow_mut().registers;
        let mut at = 0;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    let Some((&start, bytes)) = bytes.split_first() else { continue };
                    at = start;
                    for &byte in bytes {
                        // The prescaler can be set only while the chip sleeps.
                        if usize::from(at) != PRESCALE || registers[MODE1] & SLEEP != 0 {
                            registers[usize::from(at)] = byte;
                        }
                        at = at.wrapping_add(u8::from(registers[MODE1] & AUTO_INCREMENT != 0));
                    }
                }
                Operation::Read(bytes) => {
                    for byte in bytes.iter_mut() {
                        *byte = registers[usize::from(at)];
                        at = at.wrapping_add(u8::from(registers[MODE1] & AUTO_INCREMENT != 0));
                    }
                }
            }
        }
        Ok(())
    }
}

/// A PWM pin.
pub struct VirtualPwmPin {
    board: Rc<RefCell<Pins>>,
    channel: usize,
    top: u16,
}

impl PwmErrorType for VirtualPwmPin {
    type Error = Infallible;
}

impl SetDutyCycle for VirtualPwmPin {
    fn max_duty_cycle(&self) -> u16 {
        self.top
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.board.borrow_mut().tenths[self.channel] = PwmTiming::tenths_us(duty);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_futures::block_on;
    use servo_wire::bus::{Goal, ServoBus};
    use servo_wire::pca9685::OSCILLATOR_HZ;

    #[test]
    fn pulses_are_those_of_the_goals() {
        let board = HobbyBoard::default();
        let (mut pca, mut pwm) =
            (board.pca9685(OSCILLATOR_HZ).unwrap(), board.pwm(PwmTiming::of(50).unwrap()));
        let goals = [Goal { id: 7, position: 1501 }, Goal { id: 2, position: 500 }];
        for index in 0..2 {
            block_on(pca.set_torque(&[7, 2], index, true)).unwrap();
            block_on(pwm.set_torque(&[7, 2], index, true)).unwrap();
        }
        assert_eq!(board.pins().pca9685_us(7, OSCILLATOR_HZ), None);
        block_on(pca.write_goals(&goals)).unwrap();
        block_on(pwm.write_goals(&goals)).unwrap();
        let pins = board.pins();
        assert_eq!([7, 2, 3, 8].map(|pin| pins.pwm_us(pin)), [Some(1501), Some(500), None, None]);
        // A step is 4.88 µs: 308 and 102 of them are nearest.
        assert_eq!(
            [7, 2, 3, 16].map(|channel| pins.pca9685_us(channel, OSCILLATOR_HZ)),
            [Some(1503), Some(498), None, None]
        );
        // The same counts of a faster clock are shorter, unless its driver knows that.
        assert_eq!(pins.pca9685_us(7, 27_000_000), Some(1392));
        let fast = HobbyBoard::default();
        let mut pca = fast.pca9685(27_000_000).unwrap();
        block_on(pca.set_torque(&[7], 0, true)).unwrap();
        block_on(pca.write_goals(&goals[..1])).unwrap();
        assert_eq!(fast.pins().pca9685_us(7, 27_000_000), Some(1501));
        let mut bytes = pins.registers.to_vec();
        bytes.extend(pins.tenths.iter().flat_map(|tenths| tenths.to_le_bytes()));
        assert_eq!(Pins::parse(&bytes), Some(pins));
        assert_eq!(Pins::parse(&bytes[1..]), None);
    }
}
