//! Cortex-M3 and M4: three stages; loads pipeline with each other, and an address is needed a cycle early.

use super::model::{ExceptionCycles, Timing, divide};
use crate::insn::{Class, Index, Insn};
use crate::outcome::Outcome;

/// It was a load of one register that the next access may overlap.
const LOAD: u8 = 1;
/// It was a store of one register.
const STORE: u8 = 2;
/// It was a store with register offset.
const STORE_BY_REGISTER: u8 = 4;
/// It was executed and has 16 bits.
const NARROW: u8 = 8;
/// It branched.
const BRANCHED: u8 = 16;

/// What the instruction before left in the pipeline. Eight bytes, because it is written once for each instruction.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    /// What kind of instruction it was: the constants above.
    kind: u8,
    /// Registers that a data processing instruction wrote.
    computed: u16,
    /// Registers that a load wrote.
    loaded: u16,
    /// Base register that a load or store changed.
    base: u16,
}

impl Before {
    fn was(&self, kind: u8) -> bool {
        self.kind & kind != 0
    }
}

/// Cortex-M3 (`M4` false) or M4.
#[derive(Clone, Copy, Debug, Default)]
pub struct M3M4<const M4: bool> {
    before: Before,
}

impl<const M4: bool> M3M4<M4> {
    /// TRM 3.3.2: "any load or store that generates an address dependent on the result of a preceding data processing
    /// operation stalls the pipeline for an additional cycle"; pipetest: "base address and offset must be available 1
    /// cycle earlier".
    fn address_stall(&self, insn: &Insn) -> u32 {
        u32::from(insn.address & self.before.computed != 0)
    }

    /// TRM 3.3.2: an LDR is pipelined with the next LDR or STR unless that takes its address from it. pipetest: on
    /// the M3, a load with write-back only begins a chain; on the M4 two do not chain on one base.
    fn chains(&self, insn: &Insn) -> bool {
        let before = &self.before;
        before.was(LOAD)
            && insn.address & before.loaded == 0
            && if M4 { insn.base & before.base == 0 } else { insn.base == 0 }
    }

    /// pipetest: a store does not overlap the load after it. (TRM: the store buffer has one entry.)
    fn store_stall(&self) -> u32 {
        u32::from(self.before.was(STORE))
    }

    /// TRM: 2, 1 when pipelined.
    fn load(&self, insn: &Insn) -> u32 {
        let cycles = if self.chains(insn) { 1 } else { 2 };
        cycles + self.store_stall() + self.address_stall(insn)
    }

    /// TRM 3.3.2: `STR Rx,[Ry,#imm]` is always one cycle; with a register offset 2, as there are not enough read
    /// ports, unless it is pipelined after a load.
    fn store(&self, insn: &Insn) -> u32 {
        let by_register = insn.index == Index::Register;
        let cycles = if by_register && !self.chains(insn) { 2 } else { 1 };
        cycles + self.address_stall(insn)
    }

    /// TRM table 3-1: one cycle on the M4; on the M3 MLA 2, UMULL and SMULL 3 to 5, UMLAL and SMLAL 4 to 7 depending
    /// on the operands. How they depend is not published: here each operand with a significant upper half costs one,
    /// and both together one more when accumulating.
    fn multiply(insn: &Insn, outcome: &Outcome) -> u32 {
        if M4 {
            return 1;
        }
        let wide = |operand: u32| u32::from(operand >> 16 != 0);
        let (x, y) = (wide(outcome.x), wide(outcome.y));
        match insn.class {
            Class::MultiplyAccumulate => 2,
            Class::MultiplyLong => 3 + x + y,
            Class::MultiplyAccumulateLong => 4 + x + y + (x & y),
            _ => 1,
        }
    }

    /// TRM note on P, 1 to 3 "depending on the alignment and width of the target instruction": one more where that is
    /// a 32-bit instruction across a word boundary.
    fn target_stall(&self, insn: &Insn, pc: u32) -> u32 {
        u32::from(self.before.was(BRANCHED) && insn.len == 4 && pc & 2 != 0)
    }

    fn cycles(&self, insn: &Insn, outcome: &Outcome) -> u32 {
        let before = &self.before;
        match insn.class {
            Class::Alu | Class::Shifted | Class::Control | Class::Trap => 1,
            Class::Multiply
            | Class::MultiplyAccumulate
            | Class::MultiplyLong
            | Class::MultiplyAccumulateLong => Self::multiply(insn, outcome),
            Class::Divide => divide(outcome.x, outcome.y),
            // TRM 3.3.2: LDR PC is blocking and takes at least five cycles.
            Class::Load if outcome.taken => 5 + self.store_stall() + self.address_stall(insn),
            Class::Load => self.load(insn),
            Class::Store => self.store(insn),
            // TRM 3.3.2: LDRD and STRD pipeline with nothing and take three cycles.
            Class::LoadDouble => 3 + self.store_stall() + self.address_stall(insn),
            Class::StoreDouble => 3 + self.address_stall(insn),
            // TRM: 1 + N; with the pc 1 + N + P, P = 3.
            Class::LoadMultiple => {
                let refill = if outcome.taken { 3 } else { 0 };
                1 + insn.transfers() + refill + self.store_stall() + self.address_stall(insn)
            }
            Class::StoreMultiple => 1 + insn.transfers() + self.address_stall(insn),
            // M4 TRM: IT "can be folded into a preceding 16-bit Thumb instruction".
            Class::It => u32::from(!before.was(NARROW)),
            // pipetest: a load, and a store with register offset, eat the NOP after them.
            Class::Nop => u32::from(!before.was(LOAD | STORE_BY_REGISTER)),
            // TRM: 1 + B; B is not published, 3 is a refill.
            Class::Barrier => 4,
            // TRM: 1 or 2.
            Class::Status => 2,
            Class::Wait => 1,
            // TRM: 1 + P taken, 1 not taken. P = 1 for targets that are known early.
            Class::Branch => 1 + u32::from(outcome.taken),
            Class::Call => 2,
            // TRM: 1 + P; P = 2 for a target in a register.
            Class::CallRegister | Class::BranchRegister => 3,
            // TRM 3.3.2: 2 for the load, 1 for the addition, 3 for the refill.
            Class::TableBranch => 6 + self.store_stall() + self.address_stall(insn),
        }
    }
}

impl<const M4: bool> Timing for M3M4<M4> {
    /// Yiu: 12 cycles to the handler, 10 back, 6 for tail-chaining, all with memory that answers at once.
    const EXCEPTIONS: ExceptionCycles = ExceptionCycles { entry: 12, exit: 10, tail_chain: 6 };

    #[inline]
    fn step(&mut self, insn: &Insn, pc: u32, passed: bool, outcome: &Outcome) -> u32 {
        let stall = self.target_stall(insn, pc);
        if !passed {
            // TRM: an instruction whose condition fails takes one cycle.
            self.before = Before::default();
            return 1 + stall;
        }
        let cycles = self.cycles(insn, outcome) + stall;
        let narrow = if insn.len == 2 { NARROW } else { 0 };
        let branched = if outcome.taken { BRANCHED } else { 0 };
        self.before = match insn.class {
            Class::Load => Before {
                kind: LOAD | narrow | branched,
                loaded: insn.writes & !insn.base,
                base: insn.base,
                computed: 0,
            },
            Class::Store => {
                let by_register = if insn.index == Index::Register { STORE_BY_REGISTER } else { 0 };
                Before { kind: STORE | by_register | narrow, base: insn.base, ..Before::default() }
            }
            Class::StoreMultiple | Class::StoreDouble => Before { kind: narrow, ..Before::default() },
            Class::LoadMultiple | Class::LoadDouble => {
                Before { kind: narrow | branched, ..Before::default() }
            }
            Class::It | Class::Nop => Before::default(),
            _ => {
                let kind = if outcome.taken { BRANCHED } else { narrow };
                Before { kind, computed: insn.writes & 0x7fff, ..Before::default() }
            }
        };
        cycles
    }

    fn flush(&mut self) {
        self.before = Before::default();
    }
}
