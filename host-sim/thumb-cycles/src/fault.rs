//! Why a simulation cannot go on.

use std::fmt::{Display, Formatter, Result};

/// Why a load or a store failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessError {
    /// No memory and no peripheral has the address.
    Unmapped,
    /// The address is in flash.
    ReadOnly,
    /// The address is no multiple of the size, and this instruction or core needs one.
    Unaligned,
}

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Cause {
    /// The halfwords are no instruction of the core.
    #[error("{} is no instruction of this core: build for the core's Rust target, or simulate another core",
        Halfwords(*first, *second))]
    Undefined {
        /// First halfword.
        first: u16,
        /// Second halfword, if the instruction has one.
        second: Option<u16>,
    },
    /// The halfwords are an instruction of the FPU or of a coprocessor.
    #[error(
        "{first:#06x} {second:#06x} needs an FPU, which is not simulated: build for a target without (not -eabihf)"
    )]
    Coprocessor {
        /// First halfword.
        first: u16,
        /// Second halfword.
        second: u16,
    },
    /// The address of code has no memory.
    #[error(
        "there is no memory to execute from: check the function pointer that was called, and that the image was linked \
         for this board"
    )]
    Fetch,
    /// A branch to an even address asks for the Arm instruction set.
    #[error(
        "a branch to {target:#010x}, an even address, which is not Thumb code: set bit 0 of the address of a function"
    )]
    ArmState {
        /// The address.
        target: u32,
    },
    /// A load or store failed.
    #[error("a {} {address:#010x}, {}", direction(*write), advice(*error))]
    Access {
        /// The address that was accessed.
        address: u32,
        /// Whether it was a store.
        write: bool,
        /// Why it failed.
        error: AccessError,
    },
    /// SVC was executed where its handler cannot run.
    #[error(
        "an SVC where its handler cannot run: lower the priority of the code that executes it, or clear PRIMASK"
    )]
    Supervisor,
    /// A BKPT was executed that is no semihosting call.
    #[error(
        "bkpt {number:#04x}, which is no semihosting call: the image stops itself here, often because it has panicked"
    )]
    Breakpoint {
        /// The number in the instruction.
        number: u8,
    },
    /// A semihosting operation is not simulated.
    #[error(
        "semihosting operation {operation:#04x}, which is not simulated: see the documentation of `Semihosting` for those \
         that are"
    )]
    Semihosting {
        /// The number of the operation.
        operation: u32,
    },
    /// The core is asleep, and nothing could wake it.
    #[error("it sleeps, and nothing is left that could wake it: enable an interrupt before WFI or WFE")]
    SleepsForever,
    /// A return from an exception that is not being handled.
    #[error(
        "a return to {value:#010x} outside of an exception: the handler has lost the lr that it was entered with"
    )]
    ExceptionReturn {
        /// The value that was returned to.
        value: u32,
    },
    /// The image has reset itself.
    #[error("it has reset itself by AIRCR.SYSRESETREQ: make a new `Machine` to start again")]
    Reset,
}

/// The halfwords of an instruction, as text.
struct Halfwords(u16, Option<u16>);

impl Display for Halfwords {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{:#06x}", self.0)?;
        self.1.map_or(Ok(()), |second| write!(f, " {second:#06x}"))
    }
}

fn direction(write: bool) -> &'static str {
    if write { "store to" } else { "load from" }
}

fn advice(error: AccessError) -> &'static str {
    match error {
        AccessError::Unmapped => {
            "where no memory and no known peripheral is: give the board a region or attach a peripheral there"
        }
        AccessError::ReadOnly => "which is flash: only `Memory::program` writes there",
        AccessError::Unaligned => {
            "which is not aligned as this instruction needs it: use an address that is a multiple of the size"
        }
    }
}

/// A fault: what went wrong, where, and the registers.
#[derive(Clone, Debug)]
pub struct Fault {
    /// What went wrong.
    pub cause: Cause,
    /// Address of the instruction.
    pub pc: u32,
    /// The instruction's halfwords, where there is memory; the second only if the instruction has one.
    pub instruction: Option<(u16, Option<u16>)>,
    /// Name of the function that the instruction is in, if the image has symbols.
    pub function: Option<String>,
    /// `file:line` of the instruction, if the image has debug info.
    pub line: Option<String>,
    /// r0 to r12, sp, lr.
    pub registers: [u32; 15],
    /// The xPSR.
    pub xpsr: u32,
    /// Cycles until then.
    pub cycles: u64,
}

impl std::error::Error for Fault {}

impl Display for Fault {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "at {:#010x}", self.pc)?;
        if let Some(function) = &self.function {
            write!(f, " in {function}")?;
        }
        if let Some(line) = &self.line {
            write!(f, " ({line})")?;
        }
        if let Some((first, second)) = self.instruction {
            write!(f, ", instruction {}", Halfwords(first, second))?;
        }
        writeln!(f, ", cycle {}: {}", self.cycles, self.cause)?;
        for (number, value) in self.registers.iter().enumerate() {
            match number {
                13 => write!(f, "  sp {value:#010x}")?,
                14 => write!(f, "  lr {value:#010x}")?,
                _ => write!(f, "  r{number} {value:#010x}")?,
            }
            if number % 5 == 4 {
                writeln!(f)?;
            }
        }
        write!(f, "  xpsr {:#010x}", self.xpsr)
    }
}
