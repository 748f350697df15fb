//! Cortex-M0 and M0+: no instruction depends on the one before.

use super::model::{ExceptionCycles, Timing};
use crate::insn::{Class, Insn};
use crate::outcome::Outcome;

/// Cortex-M0 (`PLUS` false) or M0+.
#[derive(Clone, Copy, Debug)]
pub struct M0<const PLUS: bool> {
    multiply: u32,
}

impl<const PLUS: bool> M0<PLUS> {
    /// Refilling the pipeline: a stage more on the M0 (M0 TRM, M0+ TRM: B 3 and 2).
    const REFILL: u32 = if PLUS { 1 } else { 2 };

    /// The multiplier is a choice of the chip's maker (TRMs, note to MULS): 1 or 32 cycles.
    pub fn new(slow_multiplier: bool) -> Self {
        Self { multiply: if slow_multiplier { 32 } else { 1 } }
    }

    /// M0+ TRM, note b: 1 cycle where the access is to the single-cycle I/O port, for instance the RP2040's SIO.
    fn single_cycle_port(address: u32) -> bool {
        PLUS && address >> 28 == 0xd
    }
}

impl<const PLUS: bool> Timing for M0<PLUS> {
    /// Entry: M0 TRM 16, M0+ TRM 15. Leaving: not published; the frame's eight words, one cycle each, and a
    /// refill. Tail-chaining: not published; a vector fetch and a refill, as if nothing were stacked.
    const EXCEPTIONS: ExceptionCycles = if PLUS {
        ExceptionCycles { entry: 15, exit: 10, tail_chain: 6 }
    } else {
        ExceptionCycles { entry: 16, exit: 11, tail_chain: 7 }
    };

    #[inline]
    fn step(&mut self, insn: &Insn, _: u32, _: bool, outcome: &Outcome) -> u32 {
        let status = if PLUS { 3 } else { 4 };
        match insn.class {
            Class::Multiply => self.multiply,
            Class::Load | Class::Store if Self::single_cycle_port(outcome.address) => 1,
            Class::Load | Class::Store => 2,
            // TRMs: 1 + N; POP with the pc 3 + N (M0+) and 4 + N (M0), which is 2 + a refill.
            Class::LoadMultiple if outcome.taken => insn.transfers() + 2 + Self::REFILL,
            Class::LoadMultiple | Class::StoreMultiple => insn.transfers() + 1,
            Class::Branch | Class::BranchRegister | Class::CallRegister if outcome.taken => 1 + Self::REFILL,
            // TRMs: BL 3 (M0+), 4 (M0).
            Class::Call => 2 + Self::REFILL,
            Class::Status | Class::Barrier => status,
            Class::Wait => 2,
            _ => 1,
        }
    }

    fn flush(&mut self) {}
}
