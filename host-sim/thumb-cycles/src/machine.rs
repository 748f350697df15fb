//! The machine: a core, its bus with all that is on it, and an image.

use crate::board::Board;
use crate::bus::Bus;
use crate::call_tree::CallTree;
use crate::cores::Core;
use crate::cpu::Cpu;
use crate::error::Error;
use crate::image::Image;
use crate::memory::Memory;
use crate::peripheral::Peripheral;
use crate::semihosting::Semihosting;
use crate::stop::Usage;
use crate::system_registers::SystemRegisters;
use crate::timing::Model;
use crate::uart::CmsdkUart;
use crate::wait_states::LineBuffer;
use std::collections::BTreeSet;

/// Bytes of registers of a CMSDK UART.
const UART_BYTES: u32 = 0x1000;

/// What a core sleeps for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sleep {
    /// It is awake.
    Awake,
    /// WFI: an interrupt, masked by PRIMASK or not.
    Interrupt,
    /// WFE: an event.
    Event,
}

/// A simulated microcontroller. Two runs of one image are alike: nothing depends on the host's time.
pub struct Machine {
    /// The core's registers.
    pub cpu: Cpu,
    /// What the image says and is told by semihosting.
    pub semihosting: Semihosting,
    pub(crate) bus: Bus,
    pub(crate) core: Core,
    pub(crate) model: Model,
    pub(crate) code_buffer: LineBuffer,
    pub(crate) image: Image,
    pub(crate) sleep: Sleep,
    /// The cycle to stop at.
    pub(crate) limit: u64,
    pub(crate) breakpoints: BTreeSet<u32>,
    /// The breakpoint that running on steps over.
    pub(crate) stepping_over: Option<u32>,
    pub(crate) asleep: u64,
    pub(crate) instructions: u64,
    pub(crate) exceptions: u64,
    pub(crate) stack_top: u32,
    pub(crate) stack_low: u32,
    pub(crate) calls: CallTree,
}

impl Machine {
    /// A core on a board with an image in its memory, after reset.
    ///
    /// # Errors
    /// [`Error`] where the board's regions overlap, or the image does not fit the board.
    pub fn new(core: Core, board: &Board, image: &Image) -> Result<Self, Error> {
        let mut memory = Memory::new(board.regions.clone())?;
        image.load_into(&mut memory)?;
        let vectors = image.symbol("__vector_table").unwrap_or(board.vectors);
        let vector = |index: u32| {
            let word = memory.read::<4>(vectors.wrapping_add(index * 4));
            word.map(u32::from_le_bytes).ok_or(Error::NoVectors { board: board.name, address: vectors })
        };
        let (stack_top, start) = (vector(0)?, vector(1)? & !1);
        let mut cpu = Cpu::new(core.arch());
        cpu.pc = start;
        cpu.r[13] = stack_top & !3;
        cpu.r[14] = u32::MAX;
        let mut machine = Self {
            cpu,
            semihosting: Semihosting::default(),
            bus: Bus::new(memory, SystemRegisters::new(core, board.priority_bits, vectors)),
            core,
            model: Model::of(core),
            code_buffer: LineBuffer::default(),
            image: image.clone(),
            sleep: Sleep::Awake,
            limit: u64::MAX,
            breakpoints: BTreeSet::new(),
            stepping_over: None,
            asleep: 0,
            instructions: 0,
            exceptions: 0,
            stack_top,
            stack_low: stack_top,
            calls: CallTree::new(start, 0),
        };
        if let Some(uart) = board.uart {
            let interrupts = [uart.transmit_interrupt, uart.receive_interrupt];
            machine.attach(uart.base, UART_BYTES, &interrupts, Box::new(CmsdkUart::default()))?;
        }
        Ok(machine)
    }

    /// Puts a peripheral with `bytes` bytes of registers at the address `base`. Its interrupt lines ask for
    /// `interrupts` (0 to 239), in the order in which they are given here.
    ///
    /// # Errors
    /// [`Error::PeripheralOverlaps`] where something else is at these addresses, [`Error::NoSuchInterrupt`] where
    /// the controller does not have such an interrupt.
    pub fn attach(
        &mut self,
        base: u32,
        bytes: u32,
        interrupts: &[u16],
        peripheral: Box<dyn Peripheral>,
    ) -> Result<(), Error> {
        self.bus.attach(base, bytes, interrupts, peripheral)
    }

    /// Gives bytes that come in from outside of the chip, from now on, to the peripheral whose first register is at
    /// `base`; `false` where there is none.
    pub fn deliver(&mut self, base: u32, bytes: &[u8]) -> bool {
        self.bus.deliver(base, bytes)
    }

    /// The image that it runs.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Its memory.
    pub fn memory(&self) -> &Memory {
        &self.bus.memory
    }

    /// Its memory, to change it as a programmer does.
    pub fn memory_mut(&mut self) -> &mut Memory {
        &mut self.bus.memory
    }

    /// Its core.
    pub fn core(&self) -> Core {
        self.core
    }

    /// What was spent so far.
    pub fn usage(&self) -> Usage {
        Usage {
            cycles: self.bus.clock.now,
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
        self.bus.memory.forget_code(address);
    }

    /// Takes a breakpoint away.
    pub fn clear_breakpoint(&mut self, address: u32) {
        let address = address & !1;
        self.breakpoints.remove(&address);
        self.bus.memory.forget_code(address);
    }

    /// Cycles that the core was awake.
    pub(crate) fn awake(&self) -> u64 {
        self.bus.clock.now - self.asleep
    }
}
