//! Why a run has stopped, and what it has cost.

/// Why the simulation has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The image has ended itself with this code.
    Exit(u32),
    /// The instruction at this address, a breakpoint, is next. Running on executes it.
    Breakpoint(u32),
    /// The cycles that were allowed are over.
    Limit,
    /// A function that [`Machine::call_function`](crate::Machine::call_function) called has returned.
    Returned,
    /// A peripheral has sent a byte out of the chip.
    Sent {
        /// The peripheral's first register.
        peripheral: u32,
        /// The byte.
        byte: u8,
    },
    /// The image has written a number to a stimulus port of the ITM (0xE000_0000 + 4 * port).
    ItmWrite {
        /// The port, 0 to 31.
        port: u8,
        /// The number.
        value: u32,
    },
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
