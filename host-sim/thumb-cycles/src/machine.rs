//! The machine: fetch, execute, count, and everything that happens between two instructions.

use crate::board::{Board, Core};
use crate::calls::Calls;
use crate::cpu::Cpu;
use crate::fault::{Cause, Fault};
use crate::flash::FlashBuffer;
use crate::image::Image;
use crate::insn::Arch;
use crate::memory::{AccessError, Memory};
use crate::nvic::Nvic;
use crate::semihosting::{Files, Handle};
use crate::systick::SysTick;
use crate::timing::{M0, M3M4, M7, M33, Untimed};
use crate::uart::Uart;
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
pub(crate) enum Trap {
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
pub(crate) const RETURN: u32 = 0xfffe_fffe;

/// A core's timing.
#[derive(Clone, Debug)]
pub(crate) enum Model {
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
    // Memory.
    pub(crate) memory: Memory,
    /// What the image has written to semihosting's console, until somebody takes it.
    pub console: Vec<u8>,
    /// The files that the image sees by semihosting.
    pub files: Files,
    /// What the image gets as its command line.
    pub command_line: String,
    pub(crate) handles: Vec<Option<Handle>>,
    pub(crate) nvic: Nvic,
    pub(crate) systick: SysTick,
    pub(crate) uart: Option<Uart>,
    /// Event register of WFE.
    pub(crate) event: bool,
    pub(crate) sleeping: bool,
    pub(crate) sleeps_for_event: bool,
    pub(crate) vtor: u32,
    pub(crate) scr: u32,
    /// DEMCR and DWT_CTRL as written, and what CYCCNT is behind the cycles.
    pub(crate) demcr: u32,
    pub(crate) dwt_control: u32,
    pub(crate) cyccnt_base: u32,
    pub(crate) mark: Option<(u8, u32)>,
    pub(crate) reset: bool,
    pub(crate) core: Core,
    pub(crate) arch: Arch,
    /// ARMv6-M: no unaligned accesses.
    pub(crate) aligned_only: bool,
    pub(crate) has_dsp: bool,
    pub(crate) cycles: u64,
    pub(crate) asleep: u64,
    pub(crate) instructions: u64,
    pub(crate) exceptions: u64,
    /// The cycle at which something has to be looked at between two instructions.
    pub(crate) deadline: u64,
    /// The cycle to stop at.
    pub(crate) limit: u64,
    pub(crate) model: Model,
    pub(crate) flash: FlashBuffer,
    pub(crate) image: Image,
    pub(crate) breakpoints: BTreeSet<u32>,
    /// The breakpoint that running on steps over.
    pub(crate) skip: Option<u32>,
    pub(crate) stack_top: u32,
    pub(crate) stack_low: u32,
    pub(crate) calls: Calls,
}

impl Machine {
    /// A core on a board with an image in its memory, after reset.
    ///
    /// # Errors
    /// A sentence where the image does not fit the board.
    pub fn new(core: Core, board: &Board, image: &Image) -> Result<Self, String> {
        let mut memory = Memory::new(board.regions.clone())?;
        image.load_into(&mut memory)?;
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

    /// Its memory.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Its memory, to change it as a programmer does.
    pub fn memory_mut(&mut self) -> &mut Memory {
        &mut self.memory
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
    pub fn run_until(&mut self, limit: u64) -> Result<Stop, Box<Fault>> {
        self.limit = limit;
        self.look();
        let waits = self.memory.regions().iter().any(|region| region.wait_states.cycles > 0);
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
            let stop = self.run_until(limit);
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
    pub fn call_function(&mut self, address: u32, arguments: &[u32], limit: u64) -> Result<Stop, Box<Fault>> {
        for (register, &argument) in self.cpu.r.iter_mut().zip(arguments.iter().take(4)) {
            *register = argument;
        }
        self.cpu.r[14] = RETURN | 1;
        self.cpu.pc = address & !1;
        self.enter_call(address & !1, RETURN);
        self.run_until(limit)
    }

    /// Makes the loop look at what may have changed before the next instruction.
    pub(crate) fn look(&mut self) {
        self.deadline = 0;
    }
}
