//! Hobby servos on a PCA9685 board (16 channels over I2C) as a [`ServoBus`].
//!
//! Goal units are microseconds of pulse. All channels go out in one transfer of 65 bytes and the address: 1.5 ms at
//! 400 kbit/s. The chip counts 4096 steps a period. At 50 Hz a step is 4.9 µs, which is some half a degree of a
//! servo of 180° on 2000 µs. A PWM pin of the microcontroller ([`crate::pwm`]) is finer.
//!
//! Source: NXP, "PCA9685", revision 4, sections 7.1 (address), 7.3.1 (MODE1), 7.3.3 (on and off counts) and 7.3.5
//! (prescale).

use crate::bus::{BusError, Goal, ServoBus};
use crate::pwm::{Calibration, HobbyCommand, channel_of};
use embassy_futures::select::{Either, select};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::i2c::I2c;

/// Channels of a board.
pub const CHANNELS: usize = 16;

/// I2C address of a board none of whose address pads is bridged.
pub const DEFAULT_ADDRESS: u8 = 0x40;

/// The chip's own oscillator, nominal; it may be off by some percent from chip to chip.
pub const OSCILLATOR_HZ: u32 = 25_000_000;

/// Register with the chip's mode (section 7.3.1).
const MODE1: u8 = 0x00;
/// The chip also answers to the address [`ALL_CALL_ADDRESS`], as after power on.
const MODE1_ALL_CALL: u8 = 1 << 0;
/// The oscillator is off, and with it all channels.
const MODE1_SLEEP: u8 = 1 << 4;
/// Each byte of a transfer goes to the register behind that of the byte before.
const MODE1_AUTO_INCREMENT: u8 = 1 << 5;

/// First of the registers of the channels (section 7.3.3): low and high byte of the count at which a pulse begins,
/// then of the count at which it ends.
const FIRST_CHANNEL: u8 = 0x06;
/// Bytes of registers of a channel.
const CHANNEL_BYTES: usize = 4;
/// Bit of the count at which a pulse ends: there is no pulse.
const FULL_OFF: u16 = 1 << 12;

/// Register with the prescale (section 7.3.5), which the chip takes only while it sleeps.
const PRE_SCALE: u8 = 0xFE;

/// Address that every PCA9685 on an I2C bus answers to (section 7.1.2).
const ALL_CALL_ADDRESS: u8 = 0x70;

/// Steps in a period.
const STEPS: u32 = 4096;

/// Pulses per second.
const RATE_HZ: u32 = 50;

/// Microseconds after which a transfer is given up: 65 bytes at 100 kbit/s take 6 ms.
const LIMIT_US: u32 = 10_000;

/// Prescale for [`RATE_HZ`], by the formula of section 7.3.5: round(oscillator / (4096 · rate)) - 1.
const fn prescale(oscillator_hz: u32) -> u8 {
    let step_hz = STEPS * RATE_HZ;
    let per_step = oscillator_hz.saturating_add(step_hz / 2) / step_hz;
    match per_step.saturating_sub(1) {
        // The chip's hardware takes no less.
        0..3 => 3,
        prescale @ 3..=255 => prescale as u8,
        _ => 255,
    }
}

/// Up to 16 hobby servos on a board; a servo's id is the number of its channel.
///
/// A board that could not be reached is set up again before it is driven: it may have lost its power.
///
/// `I2C`: the bus that the board is on; `T`: the timer of the limit.
#[derive(Debug)]
pub struct Pca9685Bus<I2C, T> {
    i2c: I2C,
    address: u8,
    delay: T,
    oscillator_khz: u32,
    prescale: u8,
    calibrations: [Calibration; CHANNELS],
    commands: [HobbyCommand; CHANNELS],
    is_set_up: bool,
}

impl<I2C: I2c, T: DelayNs> Pca9685Bus<I2C, T> {
    /// A board at this address, which need not be there yet: it is set up (50 Hz, all channels low) when a servo is
    /// looked for.
    ///
    /// `address`: [`DEFAULT_ADDRESS`] to 0x7F, as its address pads are bridged. `oscillator_hz`: [`OSCILLATOR_HZ`],
    /// or what a measured period says (a period that measures 2 % too long: 2 % less).
    ///
    /// # Errors
    /// [`BusError::Unsupported`] when the oscillator cannot give 50 Hz (3 to 50 MHz can), and where the address is
    /// none of a single board.
    pub fn at(
        i2c: I2C,
        address: u8,
        delay: T,
        oscillator_hz: u32,
        calibrations: [Calibration; CHANNELS],
    ) -> Result<Self, BusError> {
        let is_board = matches!(address, DEFAULT_ADDRESS..=0x7F) && address != ALL_CALL_ADDRESS;
        if !is_board || !(3_000_000..=50_000_000).contains(&oscillator_hz) {
            return Err(BusError::Unsupported);
        }
        Ok(Self {
            i2c,
            address,
            delay,
            oscillator_khz: oscillator_hz / 1000,
            prescale: prescale(oscillator_hz),
            calibrations,
            commands: [HobbyCommand::default(); CHANNELS],
            is_set_up: false,
        })
    }

    /// Gives the I2C bus back.
    pub fn into_i2c(self) -> I2C {
        self.i2c
    }

    /// Sets the board up again, after it lost power, with what its servos were told last.
    ///
    /// # Errors
    /// [`BusError::Port`].
    pub async fn set_up(&mut self) -> Result<(), BusError> {
        let channels = self.channels();
        let Self { i2c, delay, prescale, .. } = self;
        let address = self.address;
        const ASLEEP: u8 = MODE1_ALL_CALL | MODE1_SLEEP;
        let set_up = async {
            // The chip may be awake where only the microcontroller restarted; awake it keeps its prescale.
            i2c.write(address, &[MODE1, ASLEEP]).await?;
            i2c.write(address, &[PRE_SCALE, *prescale]).await?;
            i2c.write(address, &[MODE1, ASLEEP | MODE1_AUTO_INCREMENT]).await?;
            i2c.write(address, &channels).await?;
            i2c.write(address, &[MODE1, MODE1_ALL_CALL | MODE1_AUTO_INCREMENT]).await
        };
        self.is_set_up = matches!(select(set_up, delay.delay_us(LIMIT_US)).await, Either::First(Ok(())));
        if self.is_set_up { Ok(()) } else { Err(BusError::Port) }
    }

    /// The transfer that gives all channels their pulses: the first register, then the registers.
    fn channels(&self) -> [u8; 1 + CHANNEL_BYTES * CHANNELS] {
        let step = u32::from(self.prescale).saturating_add(1).saturating_mul(1000);
        let mut bytes = [0; 1 + CHANNEL_BYTES * CHANNELS];
        let [first, registers @ ..] = &mut bytes;
        *first = FIRST_CHANNEL;
        for ([_, _, low, high], command) in
            registers.as_chunks_mut::<CHANNEL_BYTES>().0.iter_mut().zip(self.commands)
        {
            // Pulses begin at count 0.
            let end = match command.pulse_us() {
                0 => FULL_OFF,
                pulse => {
                    let counts =
                        u32::from(pulse).saturating_mul(self.oscillator_khz).saturating_add(step / 2);
                    counts.checked_div(step).unwrap_or(0).clamp(1, STEPS - 1) as u16
                }
            };
            [*low, *high] = end.to_le_bytes();
        }
        bytes
    }

    async fn output(&mut self) -> Result<(), BusError> {
        if !self.is_set_up {
            return self.set_up().await;
        }
        let channels = self.channels();
        let Self { i2c, address, delay, .. } = self;
        let output = select(i2c.write(*address, &channels), delay.delay_us(LIMIT_US)).await;
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
        let command = channel_of(ids, index).and_then(|channel| self.commands.get_mut(channel));
        command.ok_or(BusError::TooMany)?.set_torque(on);
        self.output().await
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let mut fits = Ok(());
        for goal in goals {
            let channel = usize::from(goal.id);
            match (self.commands.get_mut(channel), self.calibrations.get(channel)) {
                (Some(command), Some(calibration)) => command.set_goal(calibration.pulse_us(goal.position)),
                _ => fits = Err(BusError::TooMany),
            }
        }
        self.output().await.and(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::NoTime;
    use core::future::pending;
    use embassy_futures::block_on;
    use embedded_hal_async::i2c::{ErrorKind, ErrorType, NoAcknowledgeSource, Operation};

    /// Keeps what is written.
    #[derive(Default)]
    struct Recorder {
        written: Vec<(u8, Vec<u8>)>,
        /// Nobody answers.
        absent: bool,
        /// The clock is held low by the other side.
        stuck: bool,
    }

    impl ErrorType for Recorder {
        type Error = ErrorKind;
    }

    impl I2c for Recorder {
        async fn transaction(
            &mut self,
            address: u8,
            operations: &mut [Operation<'_>],
        ) -> Result<(), ErrorKind> {
            if self.stuck {
                pending::<()>().await;
            }
            if self.absent {
                return Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address));
            }
            for operation in operations {
                let Operation::Write(bytes) = operation else { panic!("only writes are needed") };
                self.written.push((address, bytes.to_vec()));
            }
            Ok(())
        }
    }

    fn bus(address: u8, oscillator_hz: u32) -> Result<Pca9685Bus<Recorder, NoTime>, BusError> {
        Pca9685Bus::at(Recorder::default(), address, NoTime, oscillator_hz, [Calibration::WIDE; CHANNELS])
    }

    /// The transfer of all channels: those named with their counts of end, all others off.
    fn channels(pulses: &[(usize, u16)]) -> Vec<u8> {
        let mut bytes = vec![0x06];
        for channel in 0..CHANNELS {
            let pulse = pulses.iter().find(|(named, _)| *named == channel);
            let [low, high] = pulse.map_or(0x1000_u16, |(_, end)| *end).to_le_bytes();
            bytes.extend([0, 0, low, high]);
        }
        bytes
    }

    /// What the crate pwm-pca9685 1.0.0 wrote for the same calls, as it was recorded before this driver took its
    /// place.
    #[test]
    fn writes_what_the_driver_before_it_wrote() {
        for (oscillator_hz, prescale, middle, longest) in
            [(OSCILLATOR_HZ, 0x79, 0x0133, 0x0200), (26_500_000, 0x80, 0x0134, 0x0202)]
        {
            let mut bus = bus(DEFAULT_ADDRESS, oscillator_hz).unwrap();
            let ids = [3, 0, 15];
            let goals = [(3, 1500), (0, 500), (15, 2500)].map(|(id, position)| Goal { id, position });
            block_on(bus.set_up()).unwrap();
            block_on(bus.set_torque(&ids, 0, true)).unwrap();
            block_on(bus.write_goals(&goals)).unwrap();
            block_on(bus.set_torque(&ids, 2, true)).unwrap();
            block_on(bus.ping(&ids, 2)).unwrap();
            block_on(bus.set_up()).unwrap();
            let two = channels(&[(3, middle), (15, longest)]);
            let expected = [
                vec![0x00, 0x11],
                vec![0xFE, prescale],
                vec![0x00, 0x31],
                channels(&[]),
                vec![0x00, 0x21],
                channels(&[]),
                channels(&[(3, middle)]),
                two.clone(),
                two.clone(),
                vec![0x00, 0x11],
                vec![0xFE, prescale],
                vec![0x00, 0x31],
                two,
                vec![0x00, 0x21],
            ];
            let expected: Vec<(u8, Vec<u8>)> = expected.into_iter().map(|bytes| (0x40, bytes)).collect();
            assert_eq!(bus.into_i2c().written, expected, "{oscillator_hz} Hz");
        }
    }

    #[test]
    fn a_board_is_set_up_before_its_first_pulse_and_only_then() {
        let mut bus = bus(0x41, OSCILLATOR_HZ).unwrap();
        for _ in 0..3 {
            block_on(bus.write_goals(&[])).unwrap();
        }
        let registers: Vec<u8> = bus.into_i2c().written.iter().map(|(_, bytes)| bytes[0]).collect();
        assert_eq!(registers, [0x00, 0xFE, 0x00, 0x06, 0x00, 0x06, 0x06]);
    }

    #[test]
    fn a_board_that_is_absent_or_stuck_is_an_error_and_is_set_up_again() {
        let mut bus = bus(DEFAULT_ADDRESS, OSCILLATOR_HZ).unwrap();
        block_on(bus.set_torque(&[0], 0, true)).unwrap();
        block_on(bus.write_goals(&[Goal { id: 0, position: 1500 }])).unwrap();
        for (absent, stuck) in [(true, false), (false, true)] {
            (bus.i2c.absent, bus.i2c.stuck) = (absent, stuck);
            assert_eq!(block_on(bus.ping(&[0], 0)), Err(BusError::Port));
            (bus.i2c.absent, bus.i2c.stuck) = (false, false);
            bus.i2c.written.clear();
            block_on(bus.ping(&[0], 0)).unwrap();
            let registers: Vec<u8> = bus.i2c.written.iter().map(|(_, bytes)| bytes[0]).collect();
            assert_eq!(registers, [0x00, 0xFE, 0x00, 0x06, 0x00]);
            assert_eq!(bus.i2c.written[3].1, channels(&[(0, 0x0133)]));
        }
        assert_eq!(block_on(bus.write_goals(&[Goal { id: 16, position: 1500 }])), Err(BusError::TooMany));
        assert_eq!(block_on(bus.ping(&[16], 0)), Err(BusError::TooMany));
    }

    #[test]
    fn pulses_are_as_long_as_the_chip_can_count() {
        let mut bus = bus(DEFAULT_ADDRESS, OSCILLATOR_HZ).unwrap();
        let ids: [u8; CHANNELS] = core::array::from_fn(|channel| channel as u8);
        for index in 0..CHANNELS {
            block_on(bus.set_torque(&ids, index, true)).unwrap();
        }
        // Prescale 121: a step is 122 periods of 25 MHz.
        let step_us = 122.0 / 25.0;
        for first in (500..2500).step_by(CHANNELS) {
            block_on(bus.write_goals(&ids.map(|id| Goal { id, position: first + i32::from(id) }))).unwrap();
            let (_, bytes) = bus.i2c.written.last().unwrap();
            for (position, channel) in (first..).zip(bytes[1..].chunks(CHANNEL_BYTES)) {
                let error =
                    f64::from(u16::from_le_bytes([channel[2], channel[3]])) * step_us - f64::from(position);
                assert!(error.abs() <= step_us / 2.0 + 1e-9, "{position} µs: {error} µs");
            }
        }
    }

    #[test]
    fn an_oscillator_that_cannot_do_and_an_address_that_is_none_are_refused() {
        for (hz, good) in [(2_999_999, false), (3_000_000, true), (27_000_000, true), (50_000_001, false)] {
            assert_eq!(bus(DEFAULT_ADDRESS, hz).is_ok(), good, "{hz}");
        }
        for (address, good) in [(0x3F, false), (0x40, true), (0x70, false), (0x7F, true), (0x80, false)] {
            assert_eq!(bus(address, OSCILLATOR_HZ).is_ok(), good, "{address:#x}");
        }
    }
}
