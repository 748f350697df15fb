//! The CMSDK APB UART 0 of the MPS2 boards (Arm DDI 0479, section 4.3): the servo bus.
//!
//! Its buffers are one byte each way, so what comes in is taken by the interrupt.

use crate::time::CLOCK_HZ;
use core::convert::Infallible;
use core::future::poll_fn;
use core::ptr::{read_volatile, write_volatile};
use core::task::Poll;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
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

/// Bytes that came in and were not read: more than the longest answer of 32 servos.
static RECEIVED: Pipe<CriticalSectionRawMutex, 640> = Pipe::new();

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
        Ok(RECEIVED.read(bytes).await)
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
            // What nobody reads is lost; the answer that it belongs to then fails its checksum.
            byte.into_iter().for_each(|byte| _ = RECEIVED.try_write(&[byte]));
        }
        Ok(number) if number == Interrupt::Transmitted.number() => {
            // SAFETY: clears the interrupt, which only this handler does.
            unsafe { write_volatile(INTCLEAR, TX_INTERRUPT) };
            EMPTIED.wake();
        }
        _ => defmt::panic!("interrupt {} has no handler", interrupt),
    }
}
