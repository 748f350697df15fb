//! The execution loop: fetch, execute, count; and what happens between two instructions.

use crate::decode::{advance_it, decode, is_wide};
use crate::exception::Handler;
use crate::fault::{Cause, Fault};
use crate::insn::{ALWAYS, Class, Insn, Op};
use crate::machine::{Machine, Sleep};
use crate::nvic::SV_CALL;
use crate::outcome::Outcome;
use crate::stop::Stop;
use crate::timing::{Model, Timing, Untimed};
use crate::trap::Trap;

/// Where functions that the host calls return to.
const RETURN: u32 = 0xfffe_fffe;

impl Machine {
    /// Runs until something stops it, at the latest when `limit` cycles since reset are over.
    ///
    /// # Errors
    /// A fault, with where and why.
    pub fn run_until(&mut self, limit: u64) -> Result<Stop, Box<Fault>> {
        self.limit = limit;
        self.bus.clock.expire();
        let waits = self.bus.memory.regions().iter().any(|region| region.wait_states.cycles > 0);
        let mut model = std::mem::replace(&mut self.model, Model::Untimed(Untimed));
        let result = match &mut model {
            Model::M0(timing) => self.run_with(timing, waits),
            Model::M0Plus(timing) => self.run_with(timing, waits),
            Model::M3(timing) => self.run_with(timing, waits),
            Model::M4(timing) => self.run_with(timing, waits),
            Model::M33(timing) => self.run_with(timing, waits),
            Model::M7(timing) => self.run_with(timing.as_mut(), waits),
            Model::Untimed(timing) => self.run_with(timing, waits),
        };
        self.model = model;
        result.map_err(|cause| Box::new(self.fault(cause)))
    }

    /// Runs to the end of the image, and gives its exit code; `None` where the cycles in `limit` were not enough.
    /// `device` gets what peripherals send and gives what comes back to them, `console` gets what the image writes to
    /// semihosting's console. Breakpoints and writes to the ITM do not stop it.
    ///
    /// # Errors
    /// A fault, with where and why.
    pub fn run_to_exit(
        &mut self,
        device: &mut dyn FnMut(&[u8]) -> Vec<u8>,
        console: &mut dyn FnMut(&[u8]),
        limit: u64,
    ) -> Result<Option<u32>, Box<Fault>> {
        loop {
            let stop = self.run_until(limit);
            if !self.semihosting.console.is_empty() {
                console(&std::mem::take(&mut self.semihosting.console));
            }
            match stop? {
                Stop::Exit(code) => return Ok(Some(code)),
                Stop::Limit => return Ok(None),
                Stop::Sent { peripheral, byte } => {
                    self.deliver(peripheral, &device(&[byte]));
                }
                Stop::Breakpoint(_) | Stop::Returned | Stop::ItmWrite { .. } => {}
            }
        }
    }

    /// Calls the function at `address` with up to four arguments on the stack as it is, and runs until it returns, or
    /// something else stops it. The function's result is in r0. `limit` counts cycles since reset.
    ///
    /// # Errors
    /// A fault, with where and why.
    pub fn call_function(&mut self, address: u32, arguments: &[u32], limit: u64) -> Result<Stop, Box<Fault>> {
        for (register, &argument) in self.cpu.r.iter_mut().zip(arguments.iter().take(4)) {
            *register = argument;
        }
        self.cpu.r[14] = RETURN | 1;
        self.cpu.pc = address & !1;
        self.enter_call(address & !1, RETURN);
        self.run_until(limit)
    }

    fn run_with<T: Timing>(&mut self, timing: &mut T, waits: bool) -> Result<Stop, Cause> {
        if waits { self.execute_loop::<T, true>(timing) } else { self.execute_loop::<T, false>(timing) }
    }

    fn execute_loop<T: Timing, const WAITS: bool>(&mut self, timing: &mut T) -> Result<Stop, Cause> {
        loop {
            if self.bus.clock.is_due()
                && let Some(stop) = self.handle_events(timing)?
            {
                return Ok(stop);
            }
            let pc = self.cpu.pc;
            let Some((region, at, insn)) = self.bus.memory.fetch(pc) else {
                if let Some(stop) = self.fetch_elsewhere(timing)? {
                    return Ok(stop);
                }
                continue;
            };
            let insn = *insn;
            self.cpu.r[15] = pc.wrapping_add(4);
            let mut outcome = Outcome { next: pc.wrapping_add(u32::from(insn.len)), ..Outcome::default() };
            let passed = insn.cond == ALWAYS || self.cpu.flags.pass(insn.cond);
            let mut stop = None;
            if passed && let Err(trap) = self.cpu.execute(&insn, &mut self.bus, &mut outcome) {
                match self.handle_trap(trap)? {
                    Handled::Done => {}
                    Handled::Again => continue,
                    Handled::Stop(reason) => stop = Some(reason),
                    Handled::Pause(reason) => return Ok(reason),
                }
            }
            let mut cycles = timing.step(&insn, pc, passed, &outcome);
            if WAITS {
                cycles += self.wait_cycles(&insn, pc, region, passed, &outcome, cycles);
            }
            self.bus.clock.now += u64::from(cycles);
            self.instructions += 1;
            self.bus.memory.count(region, at, cycles);
            let sp = self.cpu.r[13] & !3;
            self.cpu.r[13] = sp;
            if sp < self.stack_low {
                self.record_stack(sp);
            }
            self.cpu.pc = outcome.next;
            if outcome.taken && insn.class != Class::Branch {
                self.follow_call(&insn, pc, outcome.next);
            }
            if let Some(stop) = stop {
                return Ok(stop);
            }
        }
    }

    /// Keeps the call tree.
    #[inline]
    fn follow_call(&mut self, insn: &Insn, pc: u32, target: u32) {
        match insn.class {
            Class::Call | Class::CallRegister => {
                self.enter_call(target, pc.wrapping_add(u32::from(insn.len)));
            }
            Class::TableBranch => {}
            _ => self.calls.leave(target, self.bus.clock.now - self.asleep),
        }
    }

    fn enter_call(&mut self, target: u32, return_to: u32) {
        let awake = self.awake();
        self.calls.enter(target, return_to, awake);
    }

    /// A new low of the stack pointer counts on the main stack only.
    fn record_stack(&mut self, sp: u32) {
        if !self.cpu.on_process_stack() {
            self.stack_low = self.stack_low.min(sp);
        }
    }

    /// Cycles that the core waits for memory, for code and for data.
    fn wait_cycles(
        &mut self,
        insn: &Insn,
        pc: u32,
        region: usize,
        passed: bool,
        outcome: &Outcome,
        own: u32,
    ) -> u32 {
        let code = self.bus.memory.regions()[region].wait_states;
        let now = self.bus.clock.now;
        let mut cycles = self.code_buffer.fetch(code, pc, u32::from(insn.len), now);
        let load =
            matches!(insn.class, Class::Load | Class::LoadDouble | Class::LoadMultiple | Class::TableBranch);
        if passed
            && load
            && let Some((data, _)) = self.bus.memory.locate(outcome.address)
        {
            let waits = self.bus.memory.regions()[data].wait_states;
            let bytes = insn.transfers() * 4;
            cycles += self.code_buffer.read(waits, outcome.address, bytes, now + u64::from(own));
        }
        cycles
    }

    /// What happens between two instructions: timers, peripherals, interrupts, sleep, the limit.
    fn handle_events<T: Timing>(&mut self, timing: &mut T) -> Result<Option<Stop>, Cause> {
        if self.bus.system.reset_requested {
            return Err(Cause::Reset);
        }
        if let Some((port, value)) = self.bus.system.itm_write.take() {
            return Ok(Some(Stop::ItmWrite { port, value }));
        }
        if let Some(address) = self.stepping_over.filter(|&address| address != self.cpu.pc) {
            self.stepping_over = None;
            self.bus.memory.forget_code(address);
        }
        loop {
            if let Some((peripheral, byte)) = self.bus.advance() {
                return Ok(Some(Stop::Sent { peripheral, byte }));
            }
            if let Some(number) = self.cpu.pending_exception(&self.bus) {
                self.sleep = Sleep::Awake;
                let handler = self.cpu.enter_exception(number, &mut self.bus)?;
                self.record_stack(self.cpu.r[13]);
                self.count_exception(handler, T::EXCEPTIONS.entry);
                timing.flush();
            }
            if self.wakes() {
                self.sleep = Sleep::Awake;
            }
            if self.bus.clock.now >= self.limit {
                return Ok(Some(Stop::Limit));
            }
            if self.sleep == Sleep::Awake {
                break;
            }
            let next = self.bus.next_event().unwrap_or(u64::MAX).min(self.limit);
            if next == u64::MAX {
                return Err(Cause::SleepsForever);
            }
            let clock = &mut self.bus.clock;
            self.asleep += next.saturating_sub(clock.now);
            clock.now = clock.now.max(next);
        }
        // While a breakpoint is stepped over, the next instruction is looked at as well.
        let next = self.bus.next_event().unwrap_or(u64::MAX).min(self.limit);
        self.bus.clock.deadline = if self.stepping_over.is_some() { 0 } else { next };
        Ok(None)
    }

    /// A handler begins: `cycles` until then.
    fn count_exception(&mut self, handler: Handler, cycles: u32) {
        self.bus.clock.now += u64::from(cycles);
        self.exceptions += 1;
        self.enter_call(handler.address, handler.return_to);
    }

    /// Whether something masked ends the sleep: for WFI whatever is pending and urgent enough but for PRIMASK; for
    /// WFE only where SEVONPEND is set.
    fn wakes(&self) -> bool {
        let system = &self.bus.system;
        match self.sleep {
            Sleep::Awake => false,
            Sleep::Interrupt => system.nvic.wakes(self.cpu.basepri),
            Sleep::Event => {
                self.cpu.event || system.pending_is_event() && system.nvic.pending.iter().next().is_some()
            }
        }
    }

    /// Code that is not decoded yet, a return from an exception, or a return to the host.
    fn fetch_elsewhere<T: Timing>(&mut self, timing: &mut T) -> Result<Option<Stop>, Cause> {
        let pc = self.cpu.pc;
        if pc == RETURN {
            timing.flush();
            return Ok(Some(Stop::Returned));
        }
        if pc >= 0xf000_0000 && self.cpu.ipsr != 0 {
            match self.cpu.return_from_exception(pc | 1, &mut self.bus)? {
                Some(handler) => self.count_exception(handler, T::EXCEPTIONS.tail_chain),
                None => self.bus.clock.now += u64::from(T::EXCEPTIONS.exit),
            }
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
            let first = self.bus.memory.read::<2>(address).map_or(0, u16::from_le_bytes);
            if is_wide(first) { 4 } else { 2 }
        };
        for start in (2..=REACH).step_by(2).filter_map(|back| pc.checked_sub(back)) {
            let opens =
                self.bus.memory.fetch(start).map(|(_, _, insn)| *insn).filter(|insn| insn.op == Op::It);
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
            let half = |address: u32| self.bus.memory.read::<2>(address).map(u16::from_le_bytes);
            let first = half(address).ok_or(Cause::Fetch)?;
            let second = if is_wide(first) { half(address + 2).ok_or(Cause::Fetch)? } else { 0 };
            let mut insn = decode(self.cpu.arch, address, first, second, it);
            it = if insn.op == Op::It { insn.imm as u8 } else { advance_it(it) };
            if self.breakpoints.contains(&address) && self.stepping_over != Some(address) {
                insn.op = Op::HostBreakpoint;
                insn.cond = ALWAYS;
            }
            let len = u32::from(insn.len);
            self.bus.memory.set_code(address, insn);
            if it == 0 {
                return Ok(());
            }
            address += len;
        }
    }

    /// What the execution loop does not do itself.
    #[cold]
    fn handle_trap(&mut self, trap: Trap) -> Result<Handled, Cause> {
        let pc = self.cpu.pc;
        match trap {
            Trap::Undecoded => {
                self.decode_at(pc)?;
                Ok(Handled::Again)
            }
            Trap::HostBreakpoint => {
                // The instruction itself is next; `handle_events` puts the breakpoint back after it.
                self.stepping_over = Some(pc);
                self.bus.memory.forget_code(pc);
                Ok(Handled::Pause(Stop::Breakpoint(pc)))
            }
            Trap::Undefined => {
                let (first, second) = self.halfwords(pc).unwrap_or_default();
                Err(Cause::Undefined { first, second })
            }
            Trap::Coprocessor => {
                let (first, second) = self.halfwords(pc).unwrap_or_default();
                Err(Cause::Coprocessor { first, second: second.unwrap_or(0) })
            }
            Trap::Supervisor => {
                self.bus.system.nvic.pending.set(SV_CALL, true);
                if self.cpu.pending_exception(&self.bus).is_none() {
                    return Err(Cause::Supervisor);
                }
                self.bus.clock.expire();
                Ok(Handled::Done)
            }
            Trap::Sleep { event } => {
                // `handle_events` lets the time go by.
                self.sleep = match event {
                    true if std::mem::take(&mut self.cpu.event) => Sleep::Awake,
                    true => Sleep::Event,
                    false => Sleep::Interrupt,
                };
                self.bus.clock.expire();
                Ok(Handled::Done)
            }
            Trap::Breakpoint { number: 0xab } => match self.semihosting.operate(&mut self.cpu, &mut self.bus)
            {
                Ok(None) => Ok(Handled::Done),
                Ok(Some(code)) => Ok(Handled::Stop(Stop::Exit(code))),
                Err(Trap::Fault(cause)) => Err(cause),
                Err(_) => Err(Cause::Breakpoint { number: 0xab }),
            },
            Trap::Breakpoint { number } => Err(Cause::Breakpoint { number }),
            Trap::Fault(cause) => Err(cause),
        }
    }

    /// The halfwords of the instruction at `pc`, where there is memory.
    fn halfwords(&self, pc: u32) -> Option<(u16, Option<u16>)> {
        let half = |address: u32| self.bus.memory.read::<2>(address).map(u16::from_le_bytes);
        let first = half(pc)?;
        Some((first, is_wide(first).then(|| half(pc.wrapping_add(2)).unwrap_or(0))))
    }

    fn fault(&self, cause: Cause) -> Fault {
        let pc = self.cpu.pc;
        let function = self.image.function_at(pc).and_then(|number| self.image.functions().get(number));
        let mut registers = [0; 15];
        registers.copy_from_slice(&self.cpu.r[..15]);
        Fault {
            cause,
            pc,
            instruction: self.halfwords(pc),
            function: function.map(|function| function.name.clone()),
            line: self.image.line(pc),
            registers,
            xpsr: self.cpu.xpsr(),
            cycles: self.bus.clock.now,
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
