//! A CMSDK APB UART (Arm DDI 0479, section 4.3): a buffer of one byte each way, a start and a stop bit.

use crate::peripheral::{Peripheral, Signals};
use std::collections::VecDeque;

/// Bits on the line for a byte.
const BITS: u64 = 10;

/// Smallest divider that the UART takes.
const MIN_DIVIDER: u32 = 16;

/// STATE and CTRL and INTSTATUS bits.
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const TX_OVERRUN: u32 = 4;
const RX_OVERRUN: u32 = 8;
const TX_ENABLE: u32 = 1;
const RX_ENABLE: u32 = 2;
const TX_INTERRUPT_ENABLE: u32 = 4;
const RX_INTERRUPT_ENABLE: u32 = 8;
const TX_INTERRUPT: u32 = 1;
const RX_INTERRUPT: u32 = 2;

/// A CMSDK APB UART. Its interrupt lines are transmit and receive, in this
/// order.
#[derive(Clone, Debug, Default)]
pub struct CmsdkUart {
    data: u32,
    state: u32,
    control: u32,
    interrupt: u32,
    divider: u32,
    buffer: u8,
    /// The byte on the line, and the cycle at which it is through.
    sending: Option<(u8, u64)>,
    /// Bytes that come in, each with the cycle at which it is there.
    receiving: VecDeque<(u8, u64)>,
    /// When the line towards the core is free.
    free: u64,
}

impl CmsdkUart {
    fn byte_cycles(&self) -> u64 {
        u64::from(self.divider.max(MIN_DIVIDER)) * BITS
    }

    /// Moves the buffer onto the line, if that is free.
    fn shift_out(&mut self, now: u64) {
        let ready = self.control & TX_ENABLE != 0 && self.divider >= MIN_DIVIDER;
        if !ready || self.state & TX_FULL == 0 || self.sending.is_some() {
            return;
        }
        self.sending = Some((self.buffer, now + self.byte_cycles()));
        self.state &= !TX_FULL;
        if self.control & TX_INTERRUPT_ENABLE != 0 {
            self.interrupt |= TX_INTERRUPT;
        }
    }
}

impl Peripheral for CmsdkUart {
    fn read(&mut self, offset: u32, _: u64) -> u32 {
        match offset {
            0x0 => {
                self.state &= !RX_FULL;
                self.data
            }
            0x4 => self.state,
            0x8 => self.control,
            0xc => self.interrupt,
            0x10 => self.divider,
            // Identification registers.
            0xfd0 => 0x04,
            0xfe0 => 0x21,
            0xfe4 => 0xb8,
            0xfe8 => 0x1b,
            0xff0 => 0x0d,
            0xff4 => 0xf0,
            0xff8 => 0x05,
            0xffc => 0xb1,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, word: u32, _: u32, now: u64) {
        match offset & !3 {
            0x0 => {
                if self.state & TX_FULL != 0 {
                    self.state |= TX_OVERRUN;
                }
                self.buffer = word as u8;
                self.state |= TX_FULL;
                self.shift_out(now);
            }
            0x4 => self.state &= !(word & (TX_OVERRUN | RX_OVERRUN)),
            0x8 => {
                self.control = word & 0x7f;
                self.shift_out(now);
            }
            0xc => self.interrupt &= !word,
            0x10 => {
                self.divider = word & 0x000f_ffff;
                self.shift_out(now);
            }
            _ => {}
        }
    }

    fn advance(&mut self, now: u64) -> Signals {
        while let Some((byte, _)) = self.receiving.pop_front_if(|&mut (_, at)| at <= now) {
            if self.control & RX_ENABLE == 0 {
                continue;
            }
            if self.state & RX_FULL != 0 {
                self.state |= RX_OVERRUN;
            }
            self.data = u32::from(byte);
            self.state |= RX_FULL;
            if self.control & RX_INTERRUPT_ENABLE != 0 {
                self.interrupt |= RX_INTERRUPT;
            }
        }
        let sent = self.sending.take_if(|&mut (_, at)| at <= now).map(|(byte, _)| byte);
        if sent.is_some() {
            self.shift_out(now);
        }
        Signals { interrupts: self.interrupt, sent }
    }

    fn next_event(&self, _: u64) -> Option<u64> {
        let sent = self.sending.map(|(_, at)| at);
        let received = self.receiving.front().map(|&(_, at)| at);
        sent.into_iter().chain(received).min()
    }

    fn receive(&mut self, bytes: &[u8], now: u64) {
        for &byte in bytes {
            self.free = self.free.max(now) + self.byte_cycles();
            self.receiving.push_back((byte, self.free));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The receive and the transmit line, as they are before anything happens.
    fn lines(uart: &mut CmsdkUart) -> (bool, bool) {
        let lines = uart.advance(0).interrupts;
        (lines & RX_INTERRUPT != 0, lines & TX_INTERRUPT != 0)
    }

    #[test]
    fn a_byte_takes_ten_bits_and_the_next_waits_in_the_buffer() {
        let mut uart = CmsdkUart::default();
        uart.write(0x10, 25, 4, 0);
        uart.write(0x8, TX_ENABLE | TX_INTERRUPT_ENABLE, 4, 0);
        uart.write(0x0, 0x41, 4, 100);
        assert_eq!((uart.read(4, 0), lines(&mut uart)), (0, (false, true)));
        uart.write(0xc, 1, 4, 101);
        uart.write(0x0, 0x42, 4, 110);
        assert_eq!((uart.read(4, 0), lines(&mut uart)), (TX_FULL, (false, false)));
        assert_eq!((uart.advance(349).sent, uart.next_event(0)), (None, Some(350)));
        assert_eq!(uart.advance(350).sent, Some(0x41));
        assert_eq!((uart.read(4, 0), lines(&mut uart), uart.next_event(0)), (0, (false, true), Some(600)));
    }

    #[test]
    fn bytes_that_nobody_reads_overrun() {
        let mut uart = CmsdkUart::default();
        uart.write(0x10, 16, 4, 0);
        uart.write(0x8, RX_ENABLE | RX_INTERRUPT_ENABLE, 4, 0);
        uart.receive(b"ab", 0);
        assert_eq!(uart.advance(160).sent, None);
        assert_eq!((uart.read(4, 0), lines(&mut uart)), (RX_FULL, (true, false)));
        uart.advance(320);
        assert_eq!(uart.read(4, 0), RX_FULL | RX_OVERRUN);
        assert_eq!((uart.read(0, 0), uart.read(4, 0)), (u32::from(b'b'), RX_OVERRUN));
    }
}
