//! A half-duplex serial port: direction pin, echo, time limits.
//!
//! Every wait is bounded by a delay of the caller's timer, and every loop by the bytes that fit into that time, so
//! that a port that is stuck, babbles or fails at once cannot hold the player.

use crate::bus::BusError;
use core::ops::ControlFlow;
use embassy_futures::{poll_once, select};
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Bytes taken from the port at once.
const CHUNK: usize = 32;

/// Bytes beyond what fits into a reply's time that may come at once out of a driver's buffer.
const BACKLOG: u32 = 256;

/// Direction "pin" of boards that switch by themselves: USB adapters, RS-485 transceivers with automatic direction,
/// and UARTs whose own half-duplex mode or driver-enable output does it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Automatic;

impl ErrorType for Automatic {
    type Error = core::convert::Infallible;
}

impl OutputPin for Automatic {
    fn set_low(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// What the port knows of its wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineConfig {
    /// Bits per second, 1200 or more; a byte takes ten.
    pub baud: u32,
    /// Longest that a servo waits before it answers, in microseconds. Dynamixel and Feetech servos leave the
    /// factory with 500 (register value 250); 0 is what a puppet wants.
    pub return_delay_us: u32,
    /// What may be late beyond that, once an exchange, in microseconds: some 300 for a UART on a microcontroller,
    /// 20,000 for a USB adapter with its latency timer at 16 ms.
    pub slack_us: u32,
    /// Pause between the end of [`Write::flush`] and the switch of direction, in microseconds. For UART drivers whose
    /// flush returns while the last byte is still in the shift register: the time of one or two bytes. Else 0.
    pub turnaround_us: u32,
    /// Whether the port hears its own bytes; they are then read back and compared.
    pub echo: bool,
}

impl LineConfig {
    /// A microcontroller's UART at this rate, servos with a return delay time of 0, no echo.
    #[must_use]
    pub const fn uart(baud: u32) -> Self {
        Self { baud, return_delay_us: 0, slack_us: 300, turnaround_us: 0, echo: false }
    }

    #[allow(clippy::arithmetic_side_effects, reason = "the rate is between 1200 and u32::MAX")]
    const fn byte_ns(&self) -> u32 {
        let baud = if self.baud < 1200 { 1200 } else { self.baud };
        let (whole, rest) = (1_000_000_000 / baud, 1_000_000_000 % baud);
        // At most 8,333,340.
        whole.wrapping_mul(10).wrapping_add(rest.wrapping_mul(10) / baud).wrapping_add(1)
    }

    /// Microseconds that this many bytes take, rounded up.
    #[must_use]
    pub const fn bytes_us(&self, bytes: usize) -> u32 {
        (bytes as u32).saturating_mul(self.byte_ns()).div_ceil(1000)
    }

    /// Microseconds after which sending a packet of this many bytes is given up.
    #[must_use]
    pub const fn send_limit_us(&self, bytes: usize) -> u32 {
        self.bytes_us(bytes).saturating_add(self.turnaround_us).saturating_add(self.slack_us)
    }

    /// Microseconds after which `answers` answers of together `bytes` bytes are given up.
    #[must_use]
    pub const fn reply_limit_us(&self, bytes: usize, answers: usize) -> u32 {
        let delays = (answers as u32).saturating_mul(self.return_delay_us);
        self.bytes_us(bytes).saturating_add(delays).saturating_add(self.slack_us)
    }

    /// Longest time in microseconds of sending a packet and, with `answers`, waiting for those: limits of both
    /// directions and, with an echo, the limit for that.
    #[must_use]
    pub const fn exchange_limit_us(&self, packet: usize, bytes: usize, answers: usize) -> u32 {
        let echo = if self.echo { self.reply_limit_us(packet, 0) } else { 0 };
        let reply = if answers == 0 { 0 } else { self.reply_limit_us(bytes, answers) };
        self.send_limit_us(packet)
            .saturating_add(self.turnaround_us)
            .saturating_add(echo)
            .saturating_add(reply)
    }
}

/// Bytes that went over a port; they wrap around.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes sent.
    pub sent: u32,
    /// Bytes received, without the port's own echo.
    pub received: u32,
}

/// A half-duplex serial port.
///
/// `U`: the UART, whose reads should be cancel-safe and buffered (embassy's `BufferedUart` is). `D`: the direction
/// pin, high to send, or [`Automatic`]. `T`: the timer of all limits.
#[derive(Debug)]
pub struct Port<U, D, T> {
    uart: U,
    direction: D,
    delay: T,
    line: LineConfig,
    traffic: Traffic,
}

/// Switches to receiving when dropped, so that a cancelled send cannot leave the bus driven.
struct Sending<'d, D: OutputPin>(&'d mut D);

impl<D: OutputPin> Drop for Sending<'_, D> {
    fn drop(&mut self) {
        // A pin that fails has failed in `set_high` before, which is reported.
        let _ = self.0.set_low();
    }
}

impl<U: Read + Write, D: OutputPin, T: DelayNs> Port<U, D, T> {
    /// A port that receives until something is sent.
    pub fn new(uart: U, mut direction: D, delay: T, line: LineConfig) -> Self {
        let _ = direction.set_low();
        Self { uart, direction, delay, line, traffic: Traffic::default() }
    }

    /// What the port knows of its wire.
    pub fn line(&self) -> &LineConfig {
        &self.line
    }

    /// Changes what the port knows of its wire; the UART's own rate is the caller's matter.
    pub fn set_line(&mut self, line: LineConfig) {
        self.line = line;
    }

    /// Gives the UART back.
    pub fn into_uart(self) -> U {
        self.uart
    }

    /// The UART, to change its rate.
    pub fn uart_mut(&mut self) -> &mut U {
        &mut self.uart
    }

    /// Bytes sent and received so far.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Waits.
    pub async fn pause_us(&mut self, micros: u32) {
        self.delay.delay_us(micros).await;
    }

    /// Drops what came unasked, sends the packet, switches to receiving and, where the line echoes, takes the echo
    /// off.
    ///
    /// # Errors
    /// [`BusError::Port`] when the port takes no bytes, fails, or does not get rid of them in time;
    /// [`BusError::Corrupt`] when the echo is not the packet: the line is shorted or two are talking.
    pub async fn send(&mut self, packet: &[u8]) -> Result<(), BusError> {
        self.drain();
        let Self { uart, direction, delay, line, .. } = self;
        let sending = Sending(direction);
        sending.0.set_high().map_err(|_| BusError::Port)?;
        let write = async {
            // `write_all` panics where a driver takes nothing.
            let mut rest = packet;
            while !rest.is_empty() {
                let taken = uart.write(rest).await.map_err(|_| BusError::Port)?;
                rest = rest.get(taken..).filter(|_| taken > 0).ok_or(BusError::Port)?;
            }
            uart.flush().await.map_err(|_| BusError::Port)
        };
        let limit = delay.delay_us(line.send_limit_us(packet.len()));
        match select::select(write, limit).await {
            select::Either::First(sent) => sent?,
            select::Either::Second(()) => return Err(BusError::Port),
        }
        if line.turnaround_us > 0 {
            delay.delay_us(line.turnaround_us).await;
        }
        drop(sending);
        self.traffic.sent = self.traffic.sent.wrapping_add(packet.len() as u32);
        if self.line.echo { self.take_echo(packet).await } else { Ok(()) }
    }

    /// Gives `take` the bytes that come until it breaks, for at most `limit_us` microseconds
    /// ([`LineConfig::reply_limit_us`]). Bytes that came together with those that made it break are lost.
    ///
    /// # Errors
    /// [`BusError::NoReply`] when nothing came, [`BusError::Corrupt`] when bytes came and `take` wanted more,
    /// [`BusError::Port`] when the port only failed.
    pub async fn receive<R>(
        &mut self,
        limit_us: u32,
        mut take: impl FnMut(&[u8]) -> ControlFlow<R>,
    ) -> Result<R, BusError> {
        let Self { uart, delay, line, traffic, .. } = self;
        // More than that cannot come in this time; only a port that never waits gets there.
        let mut budget =
            limit_us.checked_div(line.byte_ns().div_ceil(1000)).unwrap_or(0).saturating_add(BACKLOG);
        let mut error = BusError::NoReply;
        let read = async {
            let mut chunk = [0; CHUNK];
            while budget > 0 {
                match uart.read(&mut chunk).await {
                    Ok(count) => {
                        let count = count.min(CHUNK);
                        // Nothing from a port without an end is a failure, and costs as one.
                        error = if count == 0 { BusError::Port } else { BusError::Corrupt };
                        budget = budget.saturating_sub(count.max(1) as u32);
                        traffic.received = traffic.received.wrapping_add(count as u32);
                        if let ControlFlow::Break(done) = take(chunk.get(..count).unwrap_or_default()) {
                            return Some(done);
                        }
                    }
                    // Framing, parity, overrun: noise on the line, so the bytes that follow count.
                    Err(_) => {
                        budget = budget.saturating_sub(1);
                        if error == BusError::NoReply {
                            error = BusError::Port;
                        }
                    }
                }
            }
            None
        };
        match select::select(read, delay.delay_us(limit_us)).await {
            select::Either::First(Some(done)) => Ok(done),
            select::Either::First(None) | select::Either::Second(()) => Err(error),
        }
    }

    /// Drops all bytes that wait in the driver: noise and answers that came too late.
    fn drain(&mut self) {
        let mut chunk = [0; CHUNK];
        for _ in 0..BACKLOG {
            match poll_once(self.uart.read(&mut chunk)) {
                core::task::Poll::Ready(Ok(1..)) => {}
                // An error is taken out of the driver by reading it.
                core::task::Poll::Ready(Err(_)) => {}
                core::task::Poll::Ready(Ok(0)) | core::task::Poll::Pending => return,
            }
        }
    }

    async fn take_echo(&mut self, packet: &[u8]) -> Result<(), BusError> {
        let Self { uart, delay, line, .. } = self;
        let read = async {
            let mut chunk = [0; CHUNK];
            let mut rest = packet;
            let mut failures = BACKLOG;
            while !rest.is_empty() && failures > 0 {
                let room = rest.len().min(CHUNK);
                match uart.read(chunk.get_mut(..room).unwrap_or_default()).await {
                    Ok(count @ 1..) => {
                        let Some((echo, later)) = rest.split_at_checked(count) else { return false };
                        if chunk.get(..count) != Some(echo) {
                            return false;
                        }
                        rest = later;
                    }
                    Ok(0) | Err(_) => failures = failures.saturating_sub(1),
                }
            }
            rest.is_empty()
        };
        match select::select(read, delay.delay_us(line.reply_limit_us(packet.len(), 0))).await {
            select::Either::First(true) => Ok(()),
            select::Either::First(false) | select::Either::Second(()) => Err(BusError::Corrupt),
        }
    }
}
