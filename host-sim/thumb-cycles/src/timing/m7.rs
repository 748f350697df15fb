//! Cortex-M7, an estimate: two instructions a cycle, each with an early and a late ALU, two banks of tightly coupled
//! memory, and a branch predictor. Rules are those of *pipetest* on an STM32H743 that matter most; the core has many
//! more. Caches are not modelled: memory answers at once.

use super::model::{ExceptionCycles, Timing, divide};
use crate::insn::{Class, Insn, Op};
use crate::outcome::Outcome;

/// Entries of the branch predictor: 2-bit counters, by address.
const PREDICTORS: usize = 512;

/// Cycles that a wrong prediction costs (pipetest: 6 to 8).
const MISS: u64 = 7;

/// What shares the cycle with the next instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Older {
    /// Nothing may join.
    Closed,
    /// An instruction of this class, with this address if it accesses memory.
    Open(Class, u32),
}

/// Cortex-M7.
#[derive(Clone, Debug)]
pub struct M7 {
    /// The cycle that is being filled.
    now: u64,
    older: Older,
    /// For each register, the first cycle in which a late ALU and an early one can use it.
    late: [u64; 16],
    early: [u64; 16],
    predictors: Vec<u8>,
}

impl Default for M7 {
    fn default() -> Self {
        Self { now: 0, older: Older::Closed, late: [0; 16], early: [0; 16], predictors: vec![1; PREDICTORS] }
    }
}

fn ready(times: &[u64; 16], registers: u16) -> u64 {
    let mut registers = registers & 0x7fff;
    let mut latest = 0;
    while registers != 0 {
        latest = latest.max(times[(registers.trailing_zeros() & 15) as usize]);
        registers &= registers - 1;
    }
    latest
}

impl M7 {
    /// Whether the instruction may share a cycle with the one before it.
    fn pairs(&self, insn: &Insn, outcome: &Outcome) -> bool {
        let Older::Open(class, address) = self.older else {
            return false;
        };
        let multiplies = |class: Class| {
            matches!(
                class,
                Class::Multiply
                    | Class::MultiplyAccumulate
                    | Class::MultiplyLong
                    | Class::MultiplyAccumulateLong
            )
        };
        match insn.class {
            // "Two loads can be dual issued if each one is targeting a different bank (even and odd words)."
            Class::Load => class != Class::Load || (address ^ outcome.address) & 4 != 0,
            // "Cannot dual issue two stores", "can't dual issue [products] with stores".
            Class::Store => class != Class::Store && !multiplies(class),
            Class::Shifted => class != Class::Shifted,
            // "Bitfield and DSP instructions must be placed in older op."
            _ if bit_manipulation(insn.op) => false,
            other if multiplies(other) => !multiplies(class) && class != Class::Store,
            Class::Alu | Class::Nop | Class::It | Class::Branch => true,
            _ => false,
        }
    }

    /// The 2-bit counter of a conditional branch: whether it was wrong.
    fn mispredicts(&mut self, pc: u32, taken: bool) -> bool {
        let counter = &mut self.predictors[(pc >> 1) as usize % PREDICTORS];
        let wrong = (*counter >= 2) != taken;
        *counter = if taken { (*counter + 1).min(3) } else { counter.saturating_sub(1) };
        wrong
    }

    /// Cycles beyond the one that it issues in.
    fn extra(insn: &Insn, outcome: &Outcome) -> u64 {
        let cycles = match insn.class {
            // "Takes ceil(regnum/2) cycles to execute."
            Class::LoadMultiple | Class::StoreMultiple => insn.transfers().div_ceil(2) - 1,
            Class::Divide => divide(outcome.x, outcome.y) - 1,
            Class::Barrier => 3,
            Class::Status => 1,
            Class::TableBranch => 4,
            _ => 0,
        };
        u64::from(cycles)
    }
}

/// "Bitfield and DSP instructions except multiplication."
fn bit_manipulation(op: Op) -> bool {
    matches!(
        op,
        Op::Bfi
            | Op::Sbfx
            | Op::Ubfx
            | Op::Ssat
            | Op::Usat
            | Op::Ssat16
            | Op::Usat16
            | Op::Clz
            | Op::Rbit
            | Op::Rev
            | Op::Rev16
            | Op::Revsh
            | Op::Sxtb
            | Op::Sxth
            | Op::Uxtb
            | Op::Uxth
            | Op::Sxtb16
            | Op::Uxtb16
            | Op::Pkh
            | Op::Parallel
            | Op::Sel
    )
}

impl Timing for M7 {
    /// Arm DDI 0489: 12 cycles with tightly coupled memory. Back and tail-chaining as on the M4.
    const EXCEPTIONS: ExceptionCycles = ExceptionCycles { entry: 12, exit: 10, tail_chain: 6 };

    fn step(&mut self, insn: &Insn, pc: u32, passed: bool, outcome: &Outcome) -> u32 {
        let before = self.now;
        let pairs = self.pairs(insn, outcome);
        let slot = if pairs || before == 0 { before } else { before + 1 };
        // Addresses, shifted operands and the operands of bit manipulation are needed early.
        let (early_needs, late_needs) = match insn.class {
            _ if !passed => (0, 0),
            Class::Shifted => (1 << (insn.m & 15), insn.reads),
            _ if bit_manipulation(insn.op) => (insn.reads, 0),
            _ => (insn.address, insn.reads & !insn.address),
        };
        let issue = slot.max(ready(&self.early, early_needs)).max(ready(&self.late, late_needs));
        // An early ALU is free for simple operations whose operands are there.
        let runs_early = insn.class == Class::Alu && ready(&self.early, insn.reads) <= issue;
        let byte = matches!(insn.op, Op::Ldrb | Op::Ldrh | Op::Ldrsb | Op::Ldrsh);
        let (late, early) = match insn.class {
            Class::Load if byte => (2, 3),
            Class::Load | Class::LoadDouble | Class::LoadMultiple => (1, 2),
            Class::Multiply
            | Class::MultiplyAccumulate
            | Class::MultiplyLong
            | Class::MultiplyAccumulateLong => (2, 3),
            _ if runs_early => (0, 1),
            _ => (1, 2),
        };
        let mut end = issue + Self::extra(insn, outcome);
        let mut written = if passed { insn.writes & 0x7fff } else { 0 };
        while written != 0 {
            let register = (written.trailing_zeros() & 15) as usize;
            written &= written - 1;
            (self.late[register], self.early[register]) = (end + late, end + early);
        }
        if passed && insn.base != 0 {
            let base = usize::from(insn.n & 15);
            (self.late[base], self.early[base]) = (issue, issue + 1);
        }
        let conditional = insn.cond != crate::insn::ALWAYS || matches!(insn.op, Op::Cbz | Op::Cbnz);
        self.older = match insn.class {
            Class::Branch if conditional => {
                if self.mispredicts(pc, outcome.taken) {
                    end += MISS;
                    Older::Closed
                } else if pairs && issue == before {
                    Older::Closed
                } else {
                    Older::Open(Class::Branch, 0)
                }
            }
            _ if outcome.taken => Older::Closed,
            Class::LoadMultiple
            | Class::StoreMultiple
            | Class::LoadDouble
            | Class::StoreDouble
            | Class::Divide
            | Class::Barrier
            | Class::Status
            | Class::Wait
            | Class::Trap => Older::Closed,
            _ if pairs && issue == before => Older::Closed,
            class => Older::Open(class, outcome.address),
        };
        self.now = end;
        (end - before) as u32
    }

    fn flush(&mut self) {
        self.older = Older::Closed;
    }
}
