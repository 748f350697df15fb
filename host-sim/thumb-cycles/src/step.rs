//! The execution loop: fetch, execute, count; and what happens between two instructions.

use crate::decode::{advance_it, decode, is_wide};
use crate::fault::{Cause, Fault};
use crate::insn::{ALWAYS, Class, Insn, Op};
use crate::machine::{Machine, Outcome, RETURN, Stop, Trap};
use crate::nvic::{SV_CALL, SYS_TICK};
use crate::timing::Timing;
use crate::uart::Uart;

impl Machine {
    pub(crate) fn run_with<T: Timing>(&mut self, timing: &mut T, waits: bool) -> Result<Stop, Cause> {
        if waits { self.execute_loop::<T, true>(timing) } else { self.execute_loop::<T, false>(timing) }
    }

    fn execute_loop<T: Timing, const WAITS: bool>(&mut self, timing: &mut T) -> Result<Stop, Cause> {
        loop {
            if self.cycles >= self.deadline
                && let Some(stop) = self.attend(timing)?
            {
                return Ok(stop);
            }
            let pc = self.cpu.pc;
            let Some((region, at, insn)) = self.memory.fetch(pc) else {
                if let Some(stop) = self.fetch_elsewhere(timing)? {
                    return Ok(stop);
                }
                continue;
            };
            let insn = *insn;
            self.cpu.r[15] = pc.wrapping_add(4);
            let mut outcome = Outcome { next: pc.wrapping_add(u32::from(insn.len)), ..Outcome::default() };
            let passed = self.cpu.flags.pass(insn.cond);
            let mut stop = None;
            if passed && let Err(trap) = self.execute(&insn, &mut outcome) {
                match self.handle(trap)? {
                    Handled::Done => {}
                    Handled::Again => continue,
                    Handled::Stop(reason) => stop = Some(reason),
                    Handled::Pause(reason) => return Ok(reason),
                }
            }
            let mut cycles = timing.step(&insn, pc, passed, &outcome);
            if WAITS {
                cycles += self.wait(&insn, pc, region, passed, &outcome, cycles);
            }
            self.cycles += u64::from(cycles);
            self.instructions += 1;
            self.memory.count(region, at, cycles);
            let sp = self.cpu.r[13] & !3;
            self.cpu.r[13] = sp;
            if sp < self.stack_low {
                self.note_stack(sp);
            }
            self.cpu.pc = outcome.next;
            if outcome.taken && insn.class != Class::Branch {
                self.follow(&insn, pc, outcome.next);
            }
            if let Some(stop) = stop {
                return Ok(stop);
            }
        }
    }

    /// Keeps the call tree.
    #[inline]
    fn follow(&mut self, insn: &Insn, pc: u32, target: u32) {
        match insn.class {
            Class::Call | Class::CallRegister => {
                self.enter_call(target, pc.wrapping_add(u32::from(insn.len)));
            }
            Class::TableBranch => {}
            _ => self.calls.leave(target, self.cycles - self.asleep),
        }
    }

    pub(crate) fn enter_call(&mut self, target: u32, return_to: u32) {
        self.calls.enter(target, return_to, self.cycles - self.asleep);
    }

    /// A new low of the stack pointer counts on the main stack only.
    pub(crate) fn note_stack(&mut self, sp: u32) {
        if !self.cpu.on_process_stack() {
            self.stack_low = self.stack_low.min(sp);
        }
    }

    fn wait(
        &mut self,
        insn: &Insn,
        pc: u32,
        region: usize,
        passed: bool,
        outcome: &Outcome,
        own: u32,
    ) -> u32 {
        let code = self.memory.regions()[region].wait_states;
        let now = self.cycles;
        let mut cycles = self.flash.fetch(code, pc, u32::from(insn.len), now);
        let load =
            matches!(insn.class, Class::Load | Class::LoadDouble | Class::LoadMultiple | Class::TableBranch);
        if passed
            && load
            && let Some((data, _)) = self.memory.locate(outcome.address)
        {
            let waits = self.memory.regions()[data].wait_states;
            let bytes = insn.transfers() * 4;
            cycles += self.flash.read(waits, outcome.address, bytes, now + u64::from(own));
        }
        cycles
    }

    /// What happens between two instructions: timers, the UART, interrupts, sleep, the limit.
    fn attend<T: Timing>(&mut self, timing: &mut T) -> Result<Option<Stop>, Cause> {
        if self.reset {
            return Err(Cause::Reset);
        }
        if let Some((port, value)) = self.mark.take() {
            return Ok(Some(Stop::Mark { port, value }));
        }
        if let Some(address) = self.skip.filter(|&address| address != self.cpu.pc) {
            self.skip = None;
            self.memory.forget_code(address);
        }
        loop {
            if let Some(byte) = self.pend_interrupts() {
                return Ok(Some(Stop::Sent(byte)));
            }
            if let Some(number) = self.pending_exception() {
                self.sleeping = false;
                self.enter_exception(number, T::EXCEPTIONS.entry)?;
                timing.flush();
            }
            if self.sleeping && self.wakes() {
                self.sleeping = false;
            }
            if self.cycles >= self.limit {
                return Ok(Some(Stop::Limit));
            }
            if !self.sleeping {
                break;
            }
            let next = self.next_event().min(self.limit);
            if next == u64::MAX {
                return Err(Cause::SleepsForever);
            }
            self.asleep += next.saturating_sub(self.cycles);
            self.cycles = self.cycles.max(next);
        }
        // While a breakpoint is stepped over, the next instruction is looked at as well.
        self.deadline = if self.skip.is_some() { 0 } else { self.next_event().min(self.limit) };
        Ok(None)
    }

    /// Asks for the interrupts that are due. Gives the byte that the UART has sent, if it has.
    fn pend_interrupts(&mut self) -> Option<u8> {
        if self.systick.due(self.cycles) {
            self.nvic.pending.set(SYS_TICK, true);
        }
        let uart = self.uart.as_mut()?;
        let sent = uart.advance(self.cycles);
        let (receive, transmit) = uart.lines();
        for (number, line) in [(uart.interrupts.0, receive), (uart.interrupts.1, transmit)] {
            if line {
                self.nvic.pending.set(16 + number, true);
            }
        }
        sent
    }

    /// Whether something masked ends the sleep: for WFI whatever is pending and urgent enough but for PRIMASK; for
    /// WFE only where SEVONPEND is set.
    fn wakes(&self) -> bool {
        const SEVONPEND: u32 = 1 << 4;
        if self.sleeps_for_event {
            self.event || self.scr & SEVONPEND != 0 && self.nvic.pending.iter().next().is_some()
        } else {
            self.nvic.wakes(self.cpu.basepri)
        }
    }

    /// The next cycle at which something happens by itself.
    fn next_event(&self) -> u64 {
        let timer = self.systick.next(self.cycles);
        let uart = self.uart.as_ref().and_then(Uart::next);
        timer.into_iter().chain(uart).min().unwrap_or(u64::MAX)
    }

    pub(crate) fn pending_exception(&self) -> Option<u16> {
        self.nvic.next(self.cpu.primask, self.cpu.faultmask, self.cpu.basepri)
    }

    /// Code that is not decoded yet, a return from an exception, or a return to the host.
    fn fetch_elsewhere<T: Timing>(&mut self, timing: &mut T) -> Result<Option<Stop>, Cause> {
        let pc = self.cpu.pc;
        if pc == RETURN {
            timing.flush();
            return Ok(Some(Stop::Returned));
        }
        if pc >= 0xf000_0000 && self.cpu.ipsr != 0 {
            self.return_from_exception(pc | 1, &T::EXCEPTIONS)?;
            timing.flush();
            return Ok(None);
        }
        self.decode_at(pc)?;
        Ok(None)
    }

    /// The IT bits at `pc`, which was reached in the block of an IT that is decoded, while it itself is not: something
    /// there was overwritten, or a breakpoint set.
    fn it_bits(&self, pc: u32) -> u8 {
        // IT and three 32-bit instructions.
        const REACH: u32 = 14;
        let len = |address: u32| {
            let first = self.memory.read::<2>(address).map_or(0, u16::from_le_bytes);
            if is_wide(first) { 4 } else { 2 }
        };
        for start in (2..=REACH).step_by(2).filter_map(|back| pc.checked_sub(back)) {
            let opens = self.memory.fetch(start).map(|(_, _, insn)| *insn).filter(|insn| insn.op == Op::It);
            let Some(opens) = opens else { continue };
            let (mut address, mut it) = (start + 2, opens.imm as u8);
            while it != 0 && address < pc {
                address += len(address);
                it = advance_it(it);
            }
            if it != 0 && address == pc {
                return it;
            }
        }
        0
    }

    /// Decodes the instruction at `pc`, and the block that it opens if it is IT.
    fn decode_at(&mut self, pc: u32) -> Result<(), Cause> {
        let (mut address, mut it) = (pc, self.it_bits(pc));
        loop {
            let half = |address: u32| self.memory.read::<2>(address).map(u16::from_le_bytes);
            let first = half(address).ok_or(Cause::Fetch)?;
            let second = if is_wide(first) { half(address + 2).ok_or(Cause::Fetch)? } else { 0 };
            let mut insn = decode(self.arch, address, first, second, it);
            it = if insn.op == Op::It { insn.imm as u8 } else { advance_it(it) };
            if self.breakpoints.contains(&address) && self.skip != Some(address) {
                insn.op = Op::HostBreakpoint;
                insn.cond = ALWAYS;
            }
            let len = u32::from(insn.len);
            self.memory.set_code(address, insn);
            if it == 0 {
                return Ok(());
            }
            address += len;
        }
    }

    /// What the execution loop does not do itself.
    #[cold]
    fn handle(&mut self, trap: Trap) -> Result<Handled, Cause> {
        let pc = self.cpu.pc;
        match trap {
            Trap::Undecoded => {
                self.decode_at(pc)?;
                Ok(Handled::Again)
            }
            Trap::HostBreakpoint => {
                // The instruction itself is next; `attend` puts the breakpoint back after it.
                self.skip = Some(pc);
                self.memory.forget_code(pc);
                Ok(Handled::Pause(Stop::Breakpoint(pc)))
            }
            Trap::Undefined => Err(self.undefined(pc)),
            Trap::Coprocessor => match self.undefined(pc) {
                Cause::Undefined { first, second } => {
                    Err(Cause::Coprocessor { first, second: second.unwrap_or(0) })
                }
                other => Err(other),
            },
            Trap::ArmState { target } => Err(Cause::ArmState { target }),
            Trap::Access { address, write, error } => Err(Cause::Access { address, write, error }),
            Trap::Supervisor => {
                self.nvic.pending.set(SV_CALL, true);
                if self.pending_exception().is_none() {
                    return Err(Cause::Supervisor);
                }
                self.look();
                Ok(Handled::Done)
            }
            Trap::Wait { event } => {
                // `attend` lets the time go by.
                self.sleeping = !(event && std::mem::take(&mut self.event));
                self.sleeps_for_event = event;
                self.look();
                Ok(Handled::Done)
            }
            Trap::Breakpoint { number: 0xab } => match self.semihosting() {
                Ok(None) => Ok(Handled::Done),
                Ok(Some(stop)) => Ok(Handled::Stop(stop)),
                Err(Trap::Access { address, write, error }) => Err(Cause::Access { address, write, error }),
                Err(Trap::Fault(cause)) => Err(cause),
                Err(_) => Err(Cause::Breakpoint { number: 0xab }),
            },
            Trap::Breakpoint { number } => Err(Cause::Breakpoint { number }),
            Trap::Fault(cause) => Err(cause),
        }
    }

    fn undefined(&self, pc: u32) -> Cause {
        let half = |address: u32| self.memory.read::<2>(address).map_or(0, u16::from_le_bytes);
        let first = half(pc);
        Cause::Undefined { first, second: is_wide(first).then(|| half(pc + 2)) }
    }

    pub(crate) fn fault(&self, cause: Cause) -> Fault {
        let pc = self.cpu.pc;
        let function = self.image.function_at(pc).and_then(|number| self.image.functions().get(number));
        let mut registers = [0; 15];
        registers.copy_from_slice(&self.cpu.r[..15]);
        Fault {
            cause,
            pc,
            function: function.map(|function| function.name.clone()),
            line: self.image.line(pc),
            registers,
            xpsr: self.cpu.xpsr(),
            cycles: self.cycles,
        }
    }
}

/// What came of a trap.
enum Handled {
    /// The instruction is done.
    Done,
    /// Fetch again.
    Again,
    /// The instruction is done and the caller wants to know.
    Stop(Stop),
    /// The caller wants to know before the instruction.
    Pause(Stop),
}
