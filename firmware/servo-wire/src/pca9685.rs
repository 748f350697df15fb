//! Hobby servos on a PCA9685 board (16 channels over I2C) as a [`ServoBus`].
//!
//! Goal units are microseconds of pulse. All channels go out in one transfer of 65 bytes and the address, 1.5 ms at 400
//! kbit/s. The chip counts 4096 steps a period: at 50 Hz a step is 4.9 µs, some half a degree of a servo of
//! 180° on 2000 µs. A PWM pin of the microcontroller ([`crate::pwm`]) is finer.

use crate::bus::{BusError, Goal, ServoBus};
use crate::pwm::{Calibration, Told, channel_of};
use embassy_futures::select::{Either, select};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::i2c::I2c;
use pwm_pca9685::{Address, ChannelOnOffControl, Pca9685};

/// Channels of a board.
pub const CHANNELS: usize = 16;

/// The chip's own oscillator, nominal; it may be off by some percent from chip to chip.
pub const OSCILLATOR_HZ: u32 = 25_000_000;

/// Steps in a period.
const STEPS: u32 = 4096;

/// Microseconds after which a transfer is given up: 65 bytes at 100 kbit/s take 6 ms.
const LIMIT_US: u32 = 10_000;

/// Up to 16 hobby servos on a board; a servo's id is the number of its channel.
///
/// A board that could not be reached is set up again before it is driven: it may have lost its power.
///
/// `I2C`: the bus that the board is on; `T`: the timer of the limit.
#[derive(Debug)]
pub struct Pca9685Bus<I2C, T> {
    board: Pca9685<I2C>,
    delay: T,
    oscillator_khz: u32,
    prescale: u8,
    calibrations: [Calibration; CHANNELS],
    told: [Told; CHANNELS],
    is_set_up: bool,
}

impl<I2C: I2c, T: DelayNs> Pca9685Bus<I2C, T> {
    /// A board at this address, which need not be there yet: it is set up (50 Hz, all channels low) when a servo is looked for.
    ///
    /// `oscillator_hz`: [`OSCILLATOR_HZ`], or what a measured period says (a period that measures 2 % too long: 2 % less).
    ///
    /// # Errors
    /// [`BusError::Unsupported`] when the oscillator cannot give 50 Hz (3 to 50 MHz can).
    pub fn at(
        i2c: I2C,
        address: Address,
        delay: T,
        oscillator_hz: u32,
        calibrations: [Calibration; CHANNELS],
    ) -> Result<Self, BusError> {
        if !(3_000_000..=50_000_000).contains(&oscillator_hz) {
            return Err(BusError::Unsupported);
        }
        // Data sheet, section 7.3.5: prescale = round(oscillator / (4096 · rate)) - 1.
        let per_step = (oscillator_hz + STEPS * 25) / (STEPS * 50);
        let prescale = per_step.saturating_sub(1).clamp(3, 255) as u8;
        let board = Pca9685::new(i2c, address).map_err(|_| BusError::Unsupported)?;
        let (told, oscillator_khz) = ([Told::default(); CHANNELS], oscillator_hz / 1000);
        Ok(Self { board, delay, oscillator_khz, prescale, calibrations, told, is_set_up: false })
    }

    /// As [`at`](Self::at), a board that is there, and is set up.
    ///
    /// # Errors
    /// As [`at`](Self::at); [`BusError::Port`] when the board does not answer.
    pub async fn new(
        i2c: I2C,
        address: Address,
        delay: T,
        oscillator_hz: u32,
        calibrations: [Calibration; CHANNELS],
    ) -> Result<Self, BusError> {
        let mut bus = Self::at(i2c, address, delay, oscillator_hz, calibrations)?;
        bus.set_up().await?;
        Ok(bus)
    }

    /// Sets the board up again, after it lost power, with what it was told last.
    ///
    /// # Errors
    /// [`BusError::Port`].
    pub async fn set_up(&mut self) -> Result<(), BusError> {
        let values = self.values();
        let Self { board, delay, prescale, .. } = self;
        board.reset_internal_driver_state();
        let set_up = async {
            // The chip may be awake where only the microcontroller restarted; awake it keeps its prescale.
            board.disable().await?;
            board.set_prescale(*prescale).await?;
            board.set_all_channels(&values).await?;
            board.enable().await
        };
        self.is_set_up = matches!(select(set_up, delay.delay_us(LIMIT_US)).await, Either::First(Ok(())));
        if self.is_set_up { Ok(()) } else { Err(BusError::Port) }
    }

    fn values(&self) -> [ChannelOnOffControl; CHANNELS] {
        let step = 1000 * (u32::from(self.prescale) + 1);
        self.told.map(|told| match told.output() {
            0 => ChannelOnOffControl { full_off: true, ..Default::default() },
            pulse => {
                let steps = (u32::from(pulse) * self.oscillator_khz + step / 2) / step;
                ChannelOnOffControl { off: steps.clamp(1, STEPS - 1) as u16, ..Default::default() }
            }
        })
    }

    async fn output(&mut self) -> Result<(), BusError> {
        if !self.is_set_up {
            return self.set_up().await;
        }
        let values = self.values();
        let Self { board, delay, .. } = self;
        let output = select(board.set_all_channels(&values), delay.delay_us(LIMIT_US)).await;
        self.is_set_up = matches!(output, Either::First(Ok(())));
        if self.is_set_up { Ok(()) } else { Err(BusError::Port) }
    }
}

impl<I2C: I2c, T: DelayNs> ServoBus for Pca9685Bus<I2C, T> {
    /// Whether the board still answers: writes what it was told last.
    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let channel = channel_of(ids, index).filter(|&channel| channel < CHANNELS);
        channel.ok_or(BusError::TooMany)?;
        self.output().await
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let told = channel_of(ids, index).and_then(|channel| self.told.get_mut(channel));
        told.ok_or(BusError::TooMany)?.torque(on);
        self.output().await
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let mut fits = Ok(());
        for goal in goals {
            let channel = usize::from(goal.id);
            match (self.told.get_mut(channel), self.calibrations.get(channel)) {
                (Some(told), Some(calibration)) => {
                    told.goal(calibration.pulse_us(goal.position));
                }
                _ => fits = Err(BusError::TooMany),
            }
        }
        self.output().await.and(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::future::pending;
    use embassy_futures::block_on;
    use embedded_hal_async::i2c::{ErrorKind, ErrorType, Operation};

    /// Bit of an "off" register that holds the channel low.
    const FULL_OFF: u16 = 1 << 12;

    /// The registers of a PCA9685, by its data sheet: writes go to an address that counts on.
    struct Chip {
        registers: [u8; 256],
        transfers: usize,
        /// Clock held low by the other side.
        stuck: bool,
        absent: bool,
    }

    impl ErrorType for Chip {
        type Error = ErrorKind;
    }

    impl I2c for Chip {
        async fn transaction(
            &mut self,
            address: u8,
            operations: &mut [Operation<'_>],
        ) -> Result<(), ErrorKind> {
            if self.stuck {
                pending::<()>().await;
            }
            if self.absent {
                return Err(ErrorKind::NoAcknowledge(embedded_hal_async::i2c::NoAcknowledgeSource::Address));
            }
            assert_eq!(address, 0x40);
            for operation in operations {
                let Operation::Write([start, bytes @ ..]) = operation else {
                    panic!("only writes are needed")
                };
                assert!(bytes.len() == 1 || self.registers[0] & 1 << 5 != 0, "auto increment");
                // The chip takes a prescale only while it sleeps.
                assert!(*start != 0xFE || self.registers[0] & 1 << 4 != 0);
                for (slot, &byte) in self.registers[usize::from(*start)..].iter_mut().zip(bytes.iter()) {
                    *slot = byte;
                }
                self.transfers += 1;
            }
            Ok(())
        }
    }

    impl Chip {
        fn new() -> Self {
            let mut registers = [0; 256];
            registers[0] = 0x11;
            Self { registers, transfers: 0, stuck: false, absent: false }
        }

        /// "On" and "off" of a channel.
        fn channel(&self, channel: usize) -> (u16, u16) {
            let at = 6 + 4 * channel;
            let word = |at| u16::from_le_bytes([self.registers[at], self.registers[at + 1]]);
            (word(at), word(at + 2))
        }
    }

    /// Every channel, in another order.
    const IDS: [u8; CHANNELS] = [5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6];

    struct NoTime;

    impl DelayNs for NoTime {
        async fn delay_ns(&mut self, _ns: u32) {}
    }

    fn bus(chip: &mut Chip) -> Result<Pca9685Bus<&mut Chip, NoTime>, BusError> {
        let calibrations = [Calibration::WIDE; CHANNELS];
        block_on(Pca9685Bus::new(chip, Address::default(), NoTime, OSCILLATOR_HZ, calibrations))
    }

    #[test]
    fn pulses_are_as_long_as_the_chip_can_count() {
        let mut chip = Chip::new();
        let mut bus = bus(&mut chip).unwrap();
        for index in 0..CHANNELS {
            block_on(bus.set_torque(&IDS, index, true)).unwrap();
        }
        let positions: [i32; CHANNELS] = core::array::from_fn(|channel| 500 + 133 * channel as i32);
        block_on(bus.write_goals(&IDS.map(|id| Goal { id, position: positions[usize::from(id)] }))).unwrap();
        let third = IDS.iter().position(|&id| id == 3).unwrap();
        block_on(bus.set_torque(&IDS, third, false)).unwrap();
        // Awake; prescale of the data sheet's formula for 50 Hz.
        assert_eq!((chip.registers[0] & 1 << 4, chip.registers[0xFE]), (0, 121));
        let step_us = 122.0 / 25.0;
        for (channel, &position) in positions.iter().enumerate() {
            let (on, off) = chip.channel(channel);
            assert_eq!(on, 0);
            if channel == 3 {
                assert_eq!(off, FULL_OFF);
            } else {
                let error = f64::from(off) * step_us - f64::from(position);
                assert!(error.abs() <= step_us / 2.0, "channel {channel}: {error} µs");
            }
        }
    }

    #[test]
    fn all_channels_go_out_in_one_transfer_and_none_without_torque() {
        let mut chip = Chip::new();
        let bus = bus(&mut chip).unwrap();
        let before = bus.board.destroy().transfers;
        let mut bus = self::bus(&mut chip).unwrap();
        block_on(bus.write_goals(&IDS.map(|id| Goal { id, position: 1500 }))).unwrap();
        assert_eq!(chip.transfers, 2 * before + 1);
        assert!(before > 0);
        assert!((0..CHANNELS).all(|channel| chip.channel(channel) == (0, FULL_OFF)));
    }

    #[test]
    fn a_board_that_is_absent_or_stuck_is_an_error() {
        let mut chip = Chip::new();
        chip.absent = true;
        assert_eq!(bus(&mut chip).err(), Some(BusError::Port));
        chip.absent = false;
        let mut bus = bus(&mut chip).unwrap();
        let goals = [Goal { id: 16, position: 1500 }];
        assert_eq!(block_on(bus.write_goals(&goals)), Err(BusError::TooMany));
        let chip = bus.board.destroy();
        chip.stuck = true;
        assert_eq!(self::bus(chip).err(), Some(BusError::Port));
    }

    #[test]
    fn a_board_that_lost_power_is_set_up_again() {
        let mut chip = Chip::new();
        let mut bus = bus(&mut chip).unwrap();
        block_on(bus.set_torque(&[0], 0, true)).unwrap();
        block_on(bus.write_goals(&[Goal { id: 0, position: 1500 }])).unwrap();
        let Pca9685Bus { board, told, .. } = bus;
        let chip = board.destroy();
        let good = chip.registers;
        *chip = Chip { absent: true, ..Chip::new() };
        let calibrations = [Calibration::WIDE; CHANNELS];
        let mut bus = Pca9685Bus::at(chip, Address::default(), NoTime, OSCILLATOR_HZ, calibrations).unwrap();
        bus.told = told;
        assert_eq!(block_on(bus.ping(&[0], 0)), Err(BusError::Port));
        let chip = bus.board.destroy();
        chip.absent = false;
        let mut bus = Pca9685Bus::at(chip, Address::default(), NoTime, OSCILLATOR_HZ, calibrations).unwrap();
        bus.told = told;
        block_on(bus.ping(&[0], 0)).unwrap();
        assert_eq!(bus.board.destroy().registers, good);
    }

    #[test]
    fn an_oscillator_that_cannot_do_is_refused() {
        for (hz, good) in [(2_999_999, false), (3_000_000, true), (27_000_000, true), (50_000_001, false)] {
            let calibrations = [Calibration::WIDE; CHANNELS];
            let bus = block_on(Pca9685Bus::new(Chip::new(), Address::default(), NoTime, hz, calibrations));
            assert_eq!(bus.is_ok(), good, "{hz}");
        }
    }
}
