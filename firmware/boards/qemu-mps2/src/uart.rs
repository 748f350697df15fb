//! The CMSDK APB UART 0 of the MPS2 boards (Arm DDI 0479, section 4.3): the servo bus.
//!
//! Its buffers are one byte each way, so what comes in is taken by the interrupt.

use crate::time::CLOCK_HZ;
use core::convert::Infallible;
use core::future::poll_fn;
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};
use core::task::Poll;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};

/// Registers of UART 0 (AN386, "Memory map").
const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CTRL: *mut u32 = 0x4000_4008 as *mut u32;
const INTCLEAR: *mut u32 = 0x4000_400c as *mut u32;
const BAUDDIV: *mut u32 = 0x4000_4010 as *mut u32;

/// STATE: the transmit buffer, one byte, is full.
const TX_FULL: u32 = 1;
/// STATE: a byte has come in.
const RX_FULL: u32 = 1 << 1;
/// CTRL: transmit and receive, and interrupt when the one buffer empties and the other fills.
const ENABLE: u32 = 0b1111;
/// INTCLEAR: the transmit and the receive interrupt.
const TX_INTERRUPT: u32 = 1;
const RX_INTERRUPT: u32 = 1 << 1;

/// Smallest divider that the UART takes.
const MIN_DIVIDER: u32 = 16;

/// Interrupts 0 and 1 (AN386, "Interrupts").
#[derive(Clone, Copy, PartialEq)]
enum Interrupt {
    Received = 0,
    Transmitted = 1,
}

// SAFETY: the numbers are those of UART 0's interrupts and never change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

static EMPTIED: AtomicWaker = AtomicWaker::new();

/// Bytes that came in and were not read; more than the longest answer of 32 servos.
///
/// One writes, the interrupt, and one reads, [`Uart`], so nobody has to keep interrupts off: at 1 Mbit/s a byte comes every 250
/// cycles, and the UART has room for one.
struct Received {
    bytes: [AtomicU8; RECEIVED_BYTES],
    /// Bytes ever written and read; they wrap around.
    written: AtomicUsize,
    read: AtomicUsize,
    waker: AtomicWaker,
}

const RECEIVED_BYTES: usize = 1024;

static RECEIVED: Received = Received {
    bytes: [const { AtomicU8::new(0) }; RECEIVED_BYTES],
    written: AtomicUsize::new(0),
    read: AtomicUsize::new(0),
    waker: AtomicWaker::new(),
};

impl Received {
    fn slot(&self, number: usize) -> &AtomicU8 {
        &self.bytes[number % RECEIVED_BYTES]
    }

    /// Only for the interrupt. What finds no room is lost; the answer that it belongs to then fails its checksum.
    fn put(&self, byte: u8) {
        let written = self.written.load(Ordering::Relaxed);
        if written.wrapping_sub(self.read.load(Ordering::Acquire)) < RECEIVED_BYTES {
            self.slot(written).store(byte, Ordering::Relaxed);
            self.written.store(written.wrapping_add(1), Ordering::Release);
        }
        self.waker.wake();
    }

    /// Only for the one reader.
    fn take(&self) -> Option<u8> {
        let read = self.read.load(Ordering::Relaxed);
        if read == self.written.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.slot(read).load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(1), Ordering::Release);
        Some(byte)
    }
}

/// Sends and receives bytes; waits for the line without spinning.
pub struct Uart(());

/// A baud rate that the clock cannot be divided to.
#[derive(defmt::Format)]
pub struct BaudError {
    baud: u32,
    highest: u32,
}

impl Uart {
    /// Takes the UART over; the interrupt controller shows that nobody else did.
    pub fn new(_nvic: NVIC, baud: u32) -> Result<Self, BaudError> {
        let divider = CLOCK_HZ / baud;
        if divider < MIN_DIVIDER {
            return Err(BaudError { baud, highest: CLOCK_HZ / MIN_DIVIDER });
        }
        // SAFETY: these are the UART's registers, and this is its only user: `NVIC` exists once. The handler of
        // the interrupt is below.
        unsafe {
            write_volatile(BAUDDIV, divider);
            write_volatile(CTRL, ENABLE);
            NVIC::unmask(Interrupt::Received);
            NVIC::unmask(Interrupt::Transmitted);
        }
        Ok(Self(()))
    }

    async fn emptied(&mut self) {
        poll_fn(|context| {
            EMPTIED.register(context.waker());
            if self.is_full() { Poll::Pending } else { Poll::Ready(()) }
        })
        .await;
    }

    fn is_full(&self) -> bool {
        // SAFETY: a readable register; `self` owns the UART.
        unsafe { read_volatile(STATE) & TX_FULL != 0 }
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(&byte) = bytes.first() else {
            return Ok(0);
        };
        self.emptied().await;
        // SAFETY: the buffer has room; `self` owns the UART.
        unsafe { write_volatile(DATA, u32::from(byte)) };
        Ok(1)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        self.emptied().await;
        Ok(())
    }
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let first = poll_fn(|context| {
            RECEIVED.waker.register(context.waker());
            RECEIVED.take().map_or(Poll::Pending, Poll::Ready)
        })
        .await;
        let all = core::iter::once(first).chain(core::iter::from_fn(|| RECEIVED.take()));
        Ok(bytes.iter_mut().zip(all).map(|(slot, byte)| *slot = byte).count())
    }
}

#[exception]
unsafe fn DefaultHandler(interrupt: i16) {
    match u16::try_from(interrupt) {
        Ok(number) if number == Interrupt::Received.number() => {
            // SAFETY: reads what came in and clears the interrupt, which only this handler does.
            let byte = unsafe {
                write_volatile(INTCLEAR, RX_INTERRUPT);
                (read_volatile(STATE) & RX_FULL != 0).then(|| read_volatile(DATA) as u8)
            };
            byte.into_iter().for_each(|byte| RECEIVED.put(byte));
        }
        Ok(number) if number == Interrupt::Transmitted.number() => {
            // SAFETY: clears the interrupt, which only this handler does.
            unsafe { write_volatile(INTCLEAR, TX_INTERRUPT) };
            EMPTIED.wake();
        }
        _ => defmt::panic!("interrupt {} has no handler", interrupt),
    }
}
