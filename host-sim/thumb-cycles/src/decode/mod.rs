//! Halfwords to [`Insn`] (Arm DDI 0403, chapter A5; DDI 0419 and DDI 0553 for what differs).

mod dsp;
mod fields;
mod narrow;
mod system;
mod wide;

use crate::insn::{Arch, Insn};

/// Whether an instruction that starts with this halfword has a second one.
pub fn is_wide(first: u16) -> bool {
    first >= 0xe800
}

/// Decodes the instruction at `pc`. `it` are the IT bits that it executes under (0 outside a block).
///
/// What the core does not have becomes [`Op::Undefined`](crate::insn::Op::Undefined), what needs an FPU [`Op::Coprocessor`](crate::insn::Op::Coprocessor).
pub fn decode(arch: Arch, pc: u32, first: u16, second: u16, it: u8) -> Insn {
    let mut insn = if is_wide(first) {
        wide::decode(arch, pc, u32::from(first), u32::from(second))
    } else {
        narrow::decode(arch, pc, u32::from(first), it != 0)
    };
    if it != 0 {
        insn.cond = it >> 4;
        // Always-true conditions have two encodings.
        if insn.cond == 15 {
            insn.cond = crate::insn::ALWAYS;
        }
    }
    insn.with_masks()
}

/// The IT bits after one instruction of the block.
pub fn advance_it(it: u8) -> u8 {
    if it & 7 == 0 { 0 } else { (it & 0xe0) | ((it << 1) & 0x1f) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::insn::Op;

    #[test]
    fn it_blocks_advance() {
        // ITTE NE: then, then, else.
        let it = 0x16;
        assert_eq!(advance_it(it), 0x0c);
        assert_eq!(advance_it(0x0c), 0x18);
        assert_eq!(advance_it(0x18), 0);
    }

    #[test]
    fn an_m0_has_no_thumb_2() {
        // movw r0, #0
        assert_eq!(decode(Arch::V6M, 0, 0xf240, 0x0000, 0).op, Op::Undefined);
        assert_eq!(decode(Arch::V7M, 0, 0xf240, 0x0000, 0).op, Op::Mov);
        // smlad r0, r1, r2, r3
        assert_eq!(decode(Arch::V7M, 0, 0xfb21, 0x3002, 0).op, Op::Undefined);
        assert_eq!(decode(Arch::V7EM, 0, 0xfb21, 0x3002, 0).op, Op::Smlad);
        // vadd.f32 s0, s0, s0
        assert_eq!(decode(Arch::V7EM, 0, 0xee30, 0x0a00, 0).op, Op::Coprocessor);
    }

    #[test]
    fn targets_are_absolute() {
        // bl to itself
        assert_eq!(decode(Arch::V6M, 0x1000, 0xf7ff, 0xfffe, 0).imm, 0x1000);
        // b to itself
        assert_eq!(decode(Arch::V6M, 0x1000, 0xe7fe, 0, 0).imm, 0x1000);
    }
}
