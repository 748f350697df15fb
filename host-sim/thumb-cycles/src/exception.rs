//! Entering and leaving exceptions (DDI 0403, B1.5.6 to B1.5.8).

use crate::cpu::Flags;
use crate::fault::Cause;
use crate::machine::{Machine, Trap};
use crate::timing::ExceptionCycles;

/// Bytes of a frame without FPU registers.
const FRAME: u32 = 32;

impl Machine {
    /// Stacks a frame and goes on in the handler of `number`.
    pub(crate) fn enter_exception(&mut self, number: u16, cycles: u32) -> Result<(), Cause> {
        let process = self.cpu.on_process_stack();
        let sp = self.cpu.r[13];
        let padded = sp & 4;
        let frame = sp.wrapping_sub(FRAME) & !7;
        let xpsr = self.cpu.xpsr() | padded << 7;
        let r = self.cpu.r;
        let words = [r[0], r[1], r[2], r[3], r[12], r[14], self.cpu.pc, xpsr];
        for (address, word) in (frame..).step_by(4).zip(words) {
            self.store::<4>(address, word, true).map_err(cause)?;
        }
        self.cpu.r[13] = frame;
        let exc_return = match (self.cpu.ipsr, process) {
            (0, true) => 0xffff_fffd,
            (0, false) => 0xffff_fff9,
            _ => 0xffff_fff1,
        };
        if process {
            std::mem::swap(&mut self.cpu.r[13], &mut self.cpu.other_sp);
            self.cpu.control &= !2;
        } else {
            self.note_stack(frame);
        }
        self.start_handler(number, exc_return, cycles)
    }

    fn start_handler(&mut self, number: u16, exc_return: u32, cycles: u32) -> Result<(), Cause> {
        let handler = self.load::<4>(self.vtor.wrapping_add(u32::from(number) * 4), true).map_err(cause)?;
        if handler & 1 == 0 {
            return Err(Cause::ArmState { target: handler });
        }
        self.cycles += u64::from(cycles);
        self.exceptions += 1;
        self.nvic.pending.set(number, false);
        self.nvic.active.set(number, true);
        self.cpu.ipsr = number;
        self.cpu.r[14] = exc_return;
        self.cpu.exclusive = None;
        self.event = true;
        self.enter_call(handler & !1, exc_return & !1);
        self.cpu.pc = handler & !1;
        Ok(())
    }

    /// A branch to `exc_return` in a handler: the next handler, or back to what was interrupted.
    pub(crate) fn return_from_exception(
        &mut self,
        exc_return: u32,
        cycles: &ExceptionCycles,
    ) -> Result<(), Cause> {
        let wrong = Cause::ExceptionReturn { value: exc_return };
        if !matches!(exc_return & 0xf, 0x1 | 0x9 | 0xd) {
            return Err(wrong);
        }
        self.nvic.active.set(self.cpu.ipsr, false);
        self.cpu.faultmask = false;
        self.event = true;
        if let Some(number) = self.pending_exception() {
            return self.start_handler(number, exc_return, cycles.tail_chain);
        }
        let thread = exc_return & 8 != 0;
        if thread != (self.nvic.active.iter().next().is_none()) {
            return Err(wrong);
        }
        if exc_return & 4 != 0 {
            std::mem::swap(&mut self.cpu.r[13], &mut self.cpu.other_sp);
            self.cpu.control |= 2;
        }
        let frame = self.cpu.r[13];
        let mut words = [0; 8];
        for (address, word) in (frame..).step_by(4).zip(&mut words) {
            *word = self.load::<4>(address, true).map_err(cause)?;
        }
        let [r0, r1, r2, r3, r12, lr, pc, xpsr] = words;
        self.cpu.r[..4].copy_from_slice(&[r0, r1, r2, r3]);
        self.cpu.r[12] = r12;
        self.cpu.r[14] = lr;
        self.cpu.pc = pc & !1;
        self.cpu.flags = Flags::from_bits(xpsr);
        self.cpu.ipsr = xpsr as u16 & 0x1ff;
        self.cpu.r[13] = frame.wrapping_add(FRAME) | (xpsr >> 7 & 4);
        self.cycles += u64::from(cycles.exit);
        self.look();
        Ok(())
    }
}

/// A frame that cannot be stacked, or a vector that cannot be read.
fn cause(trap: Trap) -> Cause {
    match trap {
        Trap::Access { address, write, error } => Cause::Access { address, write, error },
        _ => Cause::Fetch,
    }
}
