//! Entering and leaving exceptions (DDI 0403, B1.5.6 to B1.5.8).

use crate::bus::Bus;
use crate::cpu::{Cpu, Flags};
use crate::fault::Cause;
use crate::trap::Trap;

/// Bytes of a frame without FPU registers.
const FRAME: u32 = 32;

/// A handler that begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Handler {
    /// Its first instruction.
    pub address: u32,
    /// Where it returns to: EXC_RETURN, as the pc would have it.
    pub return_to: u32,
}

impl Cpu {
    /// The exception that interrupts the core now, if one does.
    pub(crate) fn pending_exception(&self, bus: &Bus) -> Option<u16> {
        bus.system.nvic.next_exception(self.masks())
    }

    /// Stacks a frame and goes on in the handler of `number`.
    pub(crate) fn enter_exception(&mut self, number: u16, bus: &mut Bus) -> Result<Handler, Cause> {
        let process = self.on_process_stack();
        let sp = self.r[13];
        let padded = sp & 4;
        let frame = sp.wrapping_sub(FRAME) & !7;
        let xpsr = self.xpsr() | padded << 7;
        let r = self.r;
        let words = [r[0], r[1], r[2], r[3], r[12], r[14], self.pc, xpsr];
        for (address, word) in (frame..).step_by(4).zip(words) {
            self.store::<4>(bus, address, word, true).map_err(cause)?;
        }
        self.r[13] = frame;
        let exc_return = match (self.ipsr, process) {
            (0, true) => 0xffff_fffd,
            (0, false) => 0xffff_fff9,
            _ => 0xffff_fff1,
        };
        if process {
            std::mem::swap(&mut self.r[13], &mut self.other_sp);
            self.control &= !2;
        }
        self.start_handler(number, exc_return, bus)
    }

    fn start_handler(&mut self, number: u16, exc_return: u32, bus: &mut Bus) -> Result<Handler, Cause> {
        let vector = bus.system.vector_table.wrapping_add(u32::from(number) * 4);
        let handler = self.load::<4>(bus, vector, true).map_err(cause)?;
        if handler & 1 == 0 {
            return Err(Cause::ArmState { target: handler });
        }
        bus.system.nvic.pending.set(number, false);
        bus.system.nvic.active.set(number, true);
        self.ipsr = number;
        self.r[14] = exc_return;
        self.exclusive = None;
        self.event = true;
        self.pc = handler & !1;
        Ok(Handler { address: self.pc, return_to: exc_return & !1 })
    }

    /// A branch to `exc_return` in a handler: to the next handler, which is given, or back to what was interrupted.
    pub(crate) fn return_from_exception(
        &mut self,
        exc_return: u32,
        bus: &mut Bus,
    ) -> Result<Option<Handler>, Cause> {
        let wrong = Cause::ExceptionReturn { value: exc_return };
        if !matches!(exc_return & 0xf, 0x1 | 0x9 | 0xd) {
            return Err(wrong);
        }
        bus.system.nvic.active.set(self.ipsr, false);
        self.faultmask = false;
        self.event = true;
        if let Some(number) = self.pending_exception(bus) {
            return self.start_handler(number, exc_return, bus).map(Some);
        }
        let thread = exc_return & 8 != 0;
        if thread != bus.system.nvic.active.iter().next().is_none() {
            return Err(wrong);
        }
        if exc_return & 4 != 0 {
            std::mem::swap(&mut self.r[13], &mut self.other_sp);
            self.control |= 2;
        }
        let frame = self.r[13];
        let mut words = [0; 8];
        for (address, word) in (frame..).step_by(4).zip(&mut words) {
            *word = self.load::<4>(bus, address, true).map_err(cause)?;
        }
        let [r0, r1, r2, r3, r12, lr, pc, xpsr] = words;
        self.r[..4].copy_from_slice(&[r0, r1, r2, r3]);
        self.r[12] = r12;
        self.r[14] = lr;
        self.pc = pc & !1;
        self.flags = Flags::from_bits(xpsr);
        self.ipsr = xpsr as u16 & 0x1ff;
        self.r[13] = frame.wrapping_add(FRAME) | (xpsr >> 7 & 4);
        bus.clock.expire();
        Ok(None)
    }
}

/// A frame that cannot be stacked, or a vector that cannot be read.
fn cause(trap: Trap) -> Cause {
    match trap {
        Trap::Fault(cause) => cause,
        _ => Cause::Fetch,
    }
}
