//! What a core's timing model is, and the one rule that several share.

use crate::insn::Insn;
use crate::outcome::Outcome;

/// Cycles of exceptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExceptionCycles {
    /// From the request to the handler's first instruction.
    pub entry: u32,
    /// From the return to the interrupted code's next instruction, beyond the returning instruction's own.
    pub exit: u32,
    /// From a handler's return to the next handler's first instruction.
    pub tail_chain: u32,
}

/// A core's timing. `step` is called once for each instruction, in order.
pub trait Timing {
    /// Cycles of exceptions.
    const EXCEPTIONS: ExceptionCycles;

    /// Cycles of one instruction at `pc`. `passed` is whether its condition held.
    fn step(&mut self, insn: &Insn, pc: u32, passed: bool, outcome: &Outcome) -> u32;

    /// Forgets the instructions before: an exception was entered or left.
    fn flush(&mut self);
}

/// Cycles of SDIV and UDIV with magnitudes `x / y`: 2 to 12, with early termination on the difference of the leading
/// zeroes (M3 TRM, M4 TRM give the range and the kind of dependence; the formula is fitted).
pub(super) fn divide(x: u32, y: u32) -> u32 {
    if y == 0 || x < y {
        return 2;
    }
    3 + (y.leading_zeros() - x.leading_zeros() + 4) / 4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divides_stay_in_the_documented_range() {
        assert_eq!(divide(1, 0), 2);
        assert_eq!(divide(1, 2), 2);
        assert_eq!(divide(7, 4), 4);
        assert_eq!(divide(u32::MAX, 1), 11);
    }
}
