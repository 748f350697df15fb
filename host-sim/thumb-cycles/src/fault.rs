//! Why a simulation cannot go on.

use crate::memory::AccessError;
use std::fmt::{Display, Formatter, Result};

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Not an instruction of the core; its halfwords.
    Undefined {
        /// First halfword.
        first: u16,
        /// Second halfword, if it has one.
        second: Option<u16>,
    },
    /// An instruction of the FPU or of a coprocessor; its halfwords.
    Coprocessor {
        /// First halfword.
        first: u16,
        /// Second halfword.
        second: u16,
    },
    /// The address of code has no memory.
    Fetch,
    /// A branch to an even address asks for the Arm instruction set.
    ArmState {
        /// Where to.
        target: u32,
    },
    /// A load or store.
    Access {
        /// Of this address.
        address: u32,
        /// Whether it is a store.
        write: bool,
        /// Why not.
        error: AccessError,
    },
    /// SVC where its handler cannot run.
    Supervisor,
    /// A breakpoint that is no semihosting call.
    Breakpoint {
        /// The instruction's number.
        number: u8,
    },
    /// A semihosting operation that is not there.
    Semihosting {
        /// Its number.
        operation: u32,
    },
    /// Asleep, and nothing that could wake it.
    SleepsForever,
    /// A return from an exception that is not being handled.
    ExceptionReturn {
        /// The value that was returned to.
        value: u32,
    },
    /// The image has reset itself.
    Reset,
}

/// A fault: what, where, and the registers.
#[derive(Clone, Debug)]
pub struct Fault {
    /// What went wrong.
    pub cause: Cause,
    /// Address of the instruction.
    pub pc: u32,
    /// The function that it is in.
    pub function: Option<String>,
    /// `file:line`, where the image has debug info.
    pub line: Option<String>,
    /// r0 to r12, sp, lr.
    pub registers: [u32; 15],
    /// The xPSR.
    pub xpsr: u32,
    /// Cycles until then.
    pub cycles: u64,
}

impl std::error::Error for Fault {}

impl Display for Cause {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match *self {
            Self::Undefined { first, second: Some(second) } => {
                write!(f, "{first:#06x} {second:#06x} is no instruction of this core")
            }
            Self::Undefined { first, second: None } => {
                write!(f, "{first:#06x} is no instruction of this core")
            }
            Self::Coprocessor { first, second } => {
                write!(
                    f,
                    "{first:#06x} {second:#06x} needs an FPU, which is not simulated: build for a target without (not -eabihf)"
                )
            }
            Self::Fetch => write!(f, "there is no memory to execute from"),
            Self::ArmState { target } => {
                write!(f, "a branch to {target:#010x}, an even address, which is not Thumb code")
            }
            Self::Access { address, write, error } => {
                let what = if write { "store to" } else { "load from" };
                let why = match error {
                    AccessError::Unmapped => "where no memory and no known peripheral is",
                    AccessError::ReadOnly => "which is flash",
                    AccessError::Unaligned => "which is not aligned as this instruction needs it",
                };
                write!(f, "a {what} {address:#010x}, {why}")
            }
            Self::Supervisor => write!(f, "an SVC where its handler cannot run"),
            Self::Breakpoint { number } => write!(f, "bkpt {number:#04x}, which is no semihosting call"),
            Self::Semihosting { operation } => {
                write!(f, "semihosting operation {operation:#04x}, which is not simulated")
            }
            Self::SleepsForever => write!(f, "it sleeps, and nothing is left that could wake it"),
            Self::ExceptionReturn { value } => write!(f, "a return to {value:#010x} outside of an exception"),
            Self::Reset => write!(f, "it has reset itself"),
        }
    }
}

impl Display for Fault {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "at {:#010x}", self.pc)?;
        if let Some(function) = &self.function {
            write!(f, " in {function}")?;
        }
        if let Some(line) = &self.line {
            write!(f, " ({line})")?;
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
