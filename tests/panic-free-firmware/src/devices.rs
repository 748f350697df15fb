//! Devices that the compiler knows nothing of: what they say comes from volatile reads.

use core::ptr::addr_of;
use embedded_hal::{digital, pwm};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::i2c::{self, I2c};
use embedded_io_async::{ErrorKind, Read, Write};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use firmware::store::{Lease, Leases, MappedFlash};

static mut BYTES: [u8; 4096] = [0; 4096];
static mut NUMBER: u32 = 0;

/// A number that the compiler cannot know, another one each time.
pub fn number() -> u32 {
    // SAFETY: one word that is always there, and nothing else runs.
    unsafe { addr_of!(NUMBER).read_volatile() }
}

/// Bytes that the compiler knows neither the values nor the number of.
pub fn bytes() -> &'static [u8] {
    let length = (number() as usize).min(4096);
    // SAFETY: inside of the array, which nothing writes.
    unsafe { core::slice::from_raw_parts(addr_of!(BYTES).cast::<u8>(), length) }
}

fn failed() -> bool {
    number() == 7
}

/// A serial port.
pub struct Uart;

impl embedded_io_async::ErrorType for Uart {
    type Error = ErrorKind;
}

impl Read for Uart {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        if failed() {
            return Err(ErrorKind::Other);
        }
        buffer.iter_mut().zip(bytes()).for_each(|(place, &byte)| *place = byte);
        // More than there is room for is what a broken driver may say.
        Ok(number() as usize)
    }
}

impl Write for Uart {
    async fn write(&mut self, _: &[u8]) -> Result<usize, ErrorKind> {
        if failed() { Err(ErrorKind::Other) } else { Ok(number() as usize) }
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        if failed() { Err(ErrorKind::Other) } else { Ok(()) }
    }
}

/// A pin, high or low, or with pulses.
pub struct Pin;

impl digital::ErrorType for Pin {
    type Error = digital::ErrorKind;
}

impl digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), digital::ErrorKind> {
        if failed() { Err(digital::ErrorKind::Other) } else { Ok(()) }
    }

    fn set_high(&mut self) -> Result<(), digital::ErrorKind> {
        self.set_low()
    }
}

impl pwm::ErrorType for Pin {
    type Error = pwm::ErrorKind;
}

impl pwm::SetDutyCycle for Pin {
    fn max_duty_cycle(&self) -> u16 {
        number() as u16
    }

    fn set_duty_cycle(&mut self, _: u16) -> Result<(), pwm::ErrorKind> {
        if failed() { Err(pwm::ErrorKind::Other) } else { Ok(()) }
    }
}

/// A timer, and an I2C bus.
pub struct Nothing;

impl DelayNs for Nothing {
    async fn delay_ns(&mut self, _: u32) {}
}

impl i2c::ErrorType for Nothing {
    type Error = i2c::ErrorKind;
}

impl I2c for Nothing {
    async fn transaction(&mut self, _: u8, _: &mut [i2c::Operation<'_>]) -> Result<(), i2c::ErrorKind> {
        if failed() { Err(i2c::ErrorKind::Other) } else { Ok(()) }
    }
}

/// Flash for clips.
pub struct Flash(Leases);

impl Flash {
    /// Nothing of it is lent.
    pub const fn new() -> Self {
        Self(Leases::new())
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        if failed() { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }

    fn capacity(&self) -> usize {
        number() as usize
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        if self.0.may_change(from, to) && !failed() { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), NorFlashErrorKind> {
        if failed() { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }
}

impl MappedFlash for Flash {
    fn mapped(&self, _: u32, _: u32) -> Option<&[u8]> {
        (!failed()).then(bytes)
    }

    fn lend(&mut self, at: u32, _: u32) -> Option<Lease> {
        self.0.lend(at, bytes())
    }

    fn take_back(&mut self, lease: Lease) {
        self.0.take_back(lease);
    }

    fn leases(&self) -> &Leases {
        &self.0
    }
}
