//! 32-bit branches and instructions on the core's state (A5.3.4; ARMv6-M has only these, DDI 0419 A5.3).

use super::fields::{bits, long_offset, reg, sign_extend, undefined};
use crate::insn::{Arch, Class, Insn, Op};

/// ARMv6-M: BL, MRS, MSR and the barriers.
pub(super) fn decode_v6m(pc: u32, first: u32, second: u32) -> Insn {
    if bits(first, 11, 2) != 2 || second & 0x8000 == 0 {
        return undefined(4);
    }
    let insn = decode(Arch::V6M, pc, first, second);
    match insn.op {
        Op::Bl | Op::Mrs | Op::Msr | Op::Barrier => insn,
        _ => undefined(4),
    }
}

pub(super) fn decode(arch: Arch, pc: u32, first: u32, second: u32) -> Insn {
    let next = pc.wrapping_add(4);
    match bits(second, 12, 3) {
        kind if kind & 5 == 5 => {
            Insn { imm: next.wrapping_add(long_offset(first, second)), ..Insn::new(Op::Bl, Class::Call, 4) }
        }
        kind if kind & 5 == 1 => {
            Insn { imm: next.wrapping_add(long_offset(first, second)), ..Insn::new(Op::B, Class::Branch, 4) }
        }
        kind if kind & 5 == 0 && bits(first, 7, 3) != 7 => {
            let offset = bits(first, 10, 1) << 20
                | bits(second, 11, 1) << 19
                | bits(second, 13, 1) << 18
                | bits(first, 0, 6) << 12
                | bits(second, 0, 11) << 1;
            Insn {
                cond: bits(first, 6, 4) as u8,
                imm: next.wrapping_add(sign_extend(offset, 21)),
                ..Insn::new(Op::B, Class::Branch, 4)
            }
        }
        kind if kind & 5 == 0 => special(arch, first, second),
        _ => undefined(4),
    }
}

fn special(arch: Arch, first: u32, second: u32) -> Insn {
    match bits(first, 4, 7) {
        0b0111000 if second & 0xf300 == 0x8000 => Insn {
            n: reg(first, 0, 4),
            imm: bits(second, 0, 8),
            amount: bits(second, 10, 2) as u8,
            ..Insn::new(Op::Msr, Class::Status, 4)
        },
        0b0111010 if first & 0xf == 0xf && second & 0xff00 == 0x8000 => match bits(second, 0, 8) {
            0 => Insn::new(Op::Nop, Class::Nop, 4),
            2 => Insn::new(Op::Wfe, Class::Wait, 4),
            3 => Insn::new(Op::Wfi, Class::Wait, 4),
            4 => Insn::new(Op::Sev, Class::Control, 4),
            _ => Insn::new(Op::Nop, Class::Nop, 4),
        },
        0b0111011 if first & 0xf == 0xf && second & 0xff00 == 0x8f00 => match bits(second, 4, 4) {
            2 if arch >= Arch::V7M && second & 0xf == 0xf => Insn::new(Op::Clrex, Class::Control, 4),
            4..=6 => Insn::new(Op::Barrier, Class::Barrier, 4),
            _ => undefined(4),
        },
        0b0111110 if first & 0xf == 0xf && second & 0xf000 == 0x8000 => {
            Insn { d: reg(second, 8, 4), imm: bits(second, 0, 8), ..Insn::new(Op::Mrs, Class::Status, 4) }
        }
        _ => undefined(4),
    }
}
