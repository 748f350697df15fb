//! What an instruction did.

/// What an instruction did, as far as the timing models ask.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Address of the next instruction.
    pub next: u32,
    /// Whether it branched.
    pub taken: bool,
    /// Address of its first access to memory.
    pub address: u32,
    /// First operand of a product, or of a division (its magnitude).
    pub x: u32,
    /// Second operand of a product, or of a division (its magnitude).
    pub y: u32,
}

impl Outcome {
    /// The instruction branches to `target`.
    #[inline]
    pub(crate) fn jump(&mut self, target: u32) {
        self.next = target;
        self.taken = true;
    }
}
