//! The clock that core and peripherals share.

/// Cycles since reset, and when the machine has to look at more than the next instruction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clock {
    /// Cycles since reset.
    pub now: u64,
    /// The cycle from which on peripherals, interrupts and the caller's limit have to be looked at.
    pub deadline: u64,
}

impl Clock {
    /// Whether something has to be looked at before the next instruction.
    #[inline]
    pub fn is_due(&self) -> bool {
        self.now >= self.deadline
    }

    /// Something may have changed: it is looked at before the next instruction.
    pub fn expire(&mut self) {
        self.deadline = 0;
    }
}
