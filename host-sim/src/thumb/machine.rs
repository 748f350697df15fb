//! The machine: fetch, execute, count, and everything that happens between two instructions.

use super::board::{Board, Core};
use super::calls::{Calls, Path};
use super::cpu::Cpu;
use super::decode::{advance_it, decode, is_wide};
use super::fault::{Cause, Fault};
use super::flash::FlashBuffer;
use super::image::Image;
use super::insn::{Arch, Class, Insn, Op};
use super::memory::{AccessError, Memory};
use super::nvic::{Nvic, SV_CALL, SYS_TICK};
use super::semihosting::{Files, Handle};
use super::systick::SysTick;
use super::timing::{M0, M3M4, M7, M33, Timing, Untimed};
use super::uart::Uart;
use std::collections::BTreeSet;

/// What an instruction did, for the timing models.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Address of the next instruction.
    pub next: u32,
    /// Whether it branched.
    pub taken: bool,
    /// Address of its first access to memory.
    pub address: u32,
    /// First operand of a product or a division (its magnitude).
    pub x: u32,
    /// Second operand.
    pub y: u32,
}

/// Why an instruction needs more than the execution loop.
#[derive(Clone, Copy, Debug)]
pub(super) enum Trap {
    Undecoded,
    Undefined,
    Coprocessor,
    HostBreakpoint,
    ArmState { target: u32 },
    Access { address: u32, write: bool, error: AccessError },
    Wait { event: bool },
    Supervisor,
    Breakpoint { number: u8 },
    Fault(Cause),
}

/// Why the simulation has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The image has ended itself with this code.
    Exit(u32),
    /// The instruction at this address, a breakpoint, is next. Running on executes it.
    Breakpoint(u32),
    /// The cycles that were allowed are over.
    Limit,
    /// A function that [`Machine::call`] called has returned.
    Returned,
    /// The UART has sent a byte.
    Sent(u8),
    /// The image has written a number to an ITM stimulus port (0xE000_0000 + 4 * port).
    Mark {
        /// Port, 0 to 31.
        port: u8,
        /// The number.
        value: u32,
    },
}

/// Where functions that the host calls return to.
const RETURN: u32 = 0xfffe_fffe;

/// A core's timing.
#[derive(Clone, Debug)]
enum Model {
    M0(M0<false>),
    M0Plus(M0<true>),
    M3(M3M4<false>),
    M4(M3M4<true>),
    M33(M33),
    M7(Box<M7>),
    Untimed(Untimed),
}

/// Cycles and how they were spent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// All cycles.
    pub cycles: u64,
    /// Cycles asleep in WFI or WFE.
    pub asleep: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Exceptions handled.
    pub exceptions: u64,
    /// Most bytes of the main stack that were in use.
    pub stack: u32,
}

/// A simulated microcontroller. Runs are alike: nothing depends on the host's time.
pub struct Machine {
    /// The core's registers.
    pub cpu: Cpu,
    /// Memory.
    pub memory: Memory,
    /// What the image has written to semihosting's console, until somebody takes it.
    pub console: Vec<u8>,
    /// The files that the image sees by semihosting.
    pub files: Files,
    /// What the image gets as its command line.
    pub command_line: String,
    pub(super) handles: Vec<Option<Handle>>,
    pub(super) nvic: Nvic,
    pub(super) systick: SysTick,
    pub(super) uart: Option<Uart>,
    /// Event register of WFE.
    pub(super) event: bool,
    sleeping: bool,
    sleeps_for_event: bool,
    pub(super) vtor: u32,
    pub(super) scr: u32,
    /// DEMCR and DWT_CTRL as written, and what CYCCNT is behind the cycles.
    pub(super) demcr: u32,
    pub(super) dwt_control: u32,
    pub(super) cyccnt_base: u32,
    pub(super) mark: Option<(u8, u32)>,
    pub(super) reset: bool,
    pub(super) core: Core,
    arch: Arch,
    /// ARMv6-M: no unaligned accesses.
    pub(super) aligned_only: bool,
    pub(super) has_dsp: bool,
    pub(super) cycles: u64,
    asleep: u64,
    instructions: u64,
    pub(super) exceptions: u64,
    /// The cycle at which something has to be looked at between two instructions.
    deadline: u64,
    /// The cycle to stop at.
    limit: u64,
    model: Model,
    flash: FlashBuffer,
    image: Image,
    breakpoints: BTreeSet<u32>,
    /// The breakpoint that running on steps over.
    skip: Option<u32>,
    stack_top: u32,
    stack_low: u32,
    calls: Calls,
}

impl Machine {
    /// A core on a board with an image in its memory, after reset.
    ///
    /// # Errors
    /// A sentence where the image does not fit the board.
    pub fn new(core: Core, board: &Board, image: &Image) -> Result<Self, String> {
        let mut memory = Memory::new(board.regions.clone())?;
        image.load(&mut memory)?;
        let vtor = image.symbol("__vector_table").unwrap_or(board.vectors);
        let vector = |index: u32| {
            memory.read::<4>(vtor + index * 4).map(u32::from_le_bytes).ok_or_else(|| {
                format!("{} has no memory at {vtor:#010x}, where the image's vectors are", board.name)
            })
        };
        let (stack_top, start) = (vector(0)?, vector(1)?);
        let arch = core.arch();
        let cpu = Cpu { pc: start & !1, ..Cpu::default() };
        let model = match core {
            Core::M0 => Model::M0(M0::new(false)),
            Core::M0Plus => Model::M0Plus(M0::new(false)),
            Core::M0PlusSlow => Model::M0Plus(M0::new(true)),
            Core::M3 => Model::M3(M3M4::default()),
            Core::M4 => Model::M4(M3M4::default()),
            Core::M33 => Model::M33(M33::default()),
            Core::M7 => Model::M7(Box::default()),
            Core::Untimed => Model::Untimed(Untimed),
        };
        let uart = board.uart.map(|(base, receive, transmit)| Uart::new(base, (receive, transmit)));
        let mut machine = Self {
            cpu,
            memory,
            console: Vec::new(),
            files: Files::new(),
            command_line: String::new(),
            handles: Vec::new(),
            nvic: Nvic::new(board.priority_bits),
            systick: SysTick::default(),
            uart,
            event: false,
            sleeping: false,
            sleeps_for_event: false,
            vtor,
            scr: 0,
            demcr: 0,
            dwt_control: 0,
            cyccnt_base: 0,
            mark: None,
            reset: false,
            core,
            arch,
            aligned_only: arch == Arch::V6M,
            has_dsp: arch >= Arch::V7EM,
            cycles: 0,
            asleep: 0,
            instructions: 0,
            exceptions: 0,
            deadline: 0,
            limit: u64::MAX,
            model,
            flash: FlashBuffer::default(),
            image: image.clone(),
            breakpoints: BTreeSet::new(),
            skip: None,
            stack_top,
            stack_low: stack_top,
            calls: Calls::new(start & !1, 0),
        };
        machine.cpu.r[13] = stack_top & !3;
        machine.cpu.r[14] = u32::MAX;
        Ok(machine)
    }

    /// The image that it runs.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Its core.
    pub fn core(&self) -> Core {
        self.core
    }

    /// What was spent so far.
    pub fn usage(&self) -> Usage {
        Usage {
            cycles: self.cycles,
            asleep: self.asleep,
            instructions: self.instructions,
            exceptions: self.exceptions,
            stack: self.stack_top.saturating_sub(self.stack_low),
        }
    }

    /// Begins to measure the stack anew, from where it is.
    pub fn reset_stack_mark(&mut self) {
        self.stack_top = self.cpu.r[13];
        self.stack_low = self.stack_top;
    }

    /// Self cycles of each function, most first; code outside of functions is `?`.
    pub fn functions(&self) -> Vec<(String, u64)> {
        let functions = self.image.functions();
        let mut cycles = vec![0u64; functions.len() + 1];
        for region in self.memory.regions() {
            for (at, &count) in region.cycles.iter().enumerate().filter(|&(_, &count)| count > 0) {
                let number = self.image.function_at(region.base + 2 * at as u32).unwrap_or(functions.len());
                cycles[number] += count;
            }
        }
        let name = |number: usize| functions.get(number).map_or("?".to_owned(), |found| found.name.clone());
        let mut list: Vec<(String, u64)> = cycles
            .into_iter()
            .enumerate()
            .filter(|&(_, cycles)| cycles > 0)
            .map(|(number, cycles)| (name(number), cycles))
            .collect();
        list.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        list
    }

    /// The tree of call paths with the cycles of each; a path's parent comes before it.
    pub fn calls(&mut self) -> &[Path] {
        self.calls.paths(self.cycles - self.asleep)
    }

    /// Forgets the cycles of functions and call paths, so that a part of a run can be looked at by itself.
    pub fn reset_profile(&mut self) {
        self.memory.forget_counts();
        self.calls = Calls::new(self.cpu.pc, self.cycles - self.asleep);
    }

    /// Stops before the instruction at `address`, at no cost in cycles.
    pub fn set_breakpoint(&mut self, address: u32) {
        let address = address & !1;
        self.breakpoints.insert(address);
        self.memory.forget_code(address);
    }

    /// Takes a breakpoint away.
    pub fn clear_breakpoint(&mut self, address: u32) {
        let address = address & !1;
        self.breakpoints.remove(&address);
        self.memory.forget_code(address);
    }

    /// Runs until something stops it, at the latest when `limit` cycles in all are over.
    ///
    /// # Errors
    /// A fault, with where and why.
    pub fn run(&mut self, limit: u64) -> Result<Stop, Box<Fault>> {
        self.limit = limit;
        self.look();
        let waits = self.memory.regions().iter().any(|region| region.waits.states > 0);
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

    /// Runs to the end of the image with a device on the UART and a log for the console, and gives the exit code.
    ///
    /// # Errors
    /// A fault; or the cycles in `limit` were not enough (`None`).
    pub fn run_to_exit(
        &mut self,
        device: &mut dyn FnMut(&[u8]) -> Vec<u8>,
        console: &mut dyn FnMut(&[u8]),
        limit: u64,
    ) -> Result<Option<u32>, Box<Fault>> {
        loop {
            let stop = self.run(limit);
            if !self.console.is_empty() {
                console(&std::mem::take(&mut self.console));
            }
            match stop? {
                Stop::Exit(code) => return Ok(Some(code)),
                Stop::Limit => return Ok(None),
                Stop::Sent(byte) => self.answer(&device(&[byte])),
                Stop::Breakpoint(_) | Stop::Returned | Stop::Mark { .. } => {}
            }
        }
    }

    /// What the device on the UART sends back, from now on.
    pub fn answer(&mut self, bytes: &[u8]) {
        let now = self.cycles;
        if let Some(uart) = &mut self.uart {
            uart.receive(bytes, now);
        }
        self.look();
    }

    /// Calls the function at `address` with up to four arguments on the stack as it is, and runs until it returns.
    /// Gives what else stops it, too. Its result is in r0.
    ///
    /// # Errors
    /// A fault.
    pub fn call(&mut self, address: u32, arguments: &[u32], limit: u64) -> Result<Stop, Box<Fault>> {
        for (register, &argument) in self.cpu.r.iter_mut().zip(arguments.iter().take(4)) {
            *register = argument;
        }
        self.cpu.r[14] = RETURN | 1;
        self.cpu.pc = address & !1;
        self.enter_call(address & !1, RETURN);
        self.run(limit)
    }

    /// Makes the loop look at what may have changed before the next instruction.
    pub(super) fn look(&mut self) {
        self.deadline = 0;
    }

    fn run_with<T: Timing>(&mut self, timing: &mut T, waits: bool) -> Result<Stop, Cause> {
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

    pub(super) fn enter_call(&mut self, target: u32, return_to: u32) {
        self.calls.enter(target, return_to, self.cycles - self.asleep);
    }

    /// A new low of the stack pointer counts on the main stack only.
    pub(super) fn note_stack(&mut self, sp: u32) {
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
        let code = self.memory.regions()[region].waits;
        let now = self.cycles;
        let mut cycles = self.flash.fetch(code, pc, u32::from(insn.len), now);
        let load =
            matches!(insn.class, Class::Load | Class::LoadDouble | Class::LoadMultiple | Class::TableBranch);
        if passed
            && load
            && let Some((data, _)) = self.memory.locate(outcome.address)
        {
            let waits = self.memory.regions()[data].waits;
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

    pub(super) fn pending_exception(&self) -> Option<u16> {
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
                insn.cond = super::insn::ALWAYS;
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

    fn fault(&self, cause: Cause) -> Fault {
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
