//! How many cycles each instruction takes, a model for each core. What is modelled, from which sources and how well
//! it agrees with published measurements is in docs/CYCLES.md; each rule here names its source.
//!
//! Sources, by the names that the rules use:
//! - *M0+ TRM*: Arm DDI 0484C, Cortex-M0+ Technical Reference Manual, table 3-1.
//! - *M0 TRM*: Arm DDI 0432C, Cortex-M0 Technical Reference Manual, table 3-1.
//! - *M3 TRM*: Arm DDI 0337H, Cortex-M3 Technical Reference Manual, table 3-1 and section 3.3.2.
//! - *M4 TRM*: Arm DDI 0439B, Cortex-M4 Technical Reference Manual, table 3-1 and section 3.3.2.
//! - *pipetest*: measurements on STM32F103, STM32F407, RP2350 and STM32H743 by J. K. (github jnk0le/random,
//!   "pipeline cycle test").
//! - *Yiu*: J. Yiu, "The Definitive Guide to Arm Cortex-M3 and Cortex-M4 Processors", 3rd edition, chapter 8.

mod m0;
mod m33;
mod m3m4;
mod m7;

pub use m0::M0;
pub use m3m4::M3M4;
pub use m7::M7;
pub use m33::M33;

use crate::insn::Insn;
use crate::machine::Outcome;

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

/// One cycle for every instruction: to see what timing costs the host.
#[derive(Clone, Copy, Debug, Default)]
pub struct Untimed;

impl Timing for Untimed {
    const EXCEPTIONS: ExceptionCycles = ExceptionCycles { entry: 0, exit: 0, tail_chain: 0 };

    #[inline]
    fn step(&mut self, _: &Insn, _: u32, _: bool, _: &Outcome) -> u32 {
        1
    }

    fn flush(&mut self) {}
}

/// Cycles of SDIV and UDIV with magnitudes `x / y`: 2 to 12, with early termination on the difference of the leading
/// zeroes (M3 TRM, M4 TRM give the range and the kind of dependence; the formula is fitted).
fn divide(x: u32, y: u32) -> u32 {
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
