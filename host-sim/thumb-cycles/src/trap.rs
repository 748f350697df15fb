//! Why an instruction needs more than the execution of one instruction.

use crate::fault::{AccessError, Cause};

#[derive(Clone, Copy, Debug)]
pub(crate) enum Trap {
    /// The instruction is not decoded yet.
    Undecoded,
    /// The halfwords are no instruction of the core.
    Undefined,
    /// The halfwords are an instruction of an FPU or a coprocessor.
    Coprocessor,
    /// The host has set a breakpoint here.
    HostBreakpoint,
    /// WFI, or with `event` WFE.
    Sleep { event: bool },
    /// SVC.
    Supervisor,
    /// BKPT.
    Breakpoint { number: u8 },
    /// The core cannot go on.
    Fault(Cause),
}

impl Trap {
    /// A load or store that failed.
    pub fn access(address: u32, write: bool, error: AccessError) -> Self {
        Self::Fault(Cause::Access { address, write, error })
    }
}
