//! Fields of an encoding: bits, registers, shifts, offsets.

use crate::insn::{Class, Insn, Op, Shift};

/// What stands for halfwords that are no instruction.
pub(super) fn undefined(len: u8) -> Insn {
    Insn::new(Op::Undefined, Class::Control, len)
}

/// The `count` bits of `word` from `low` on.
pub(super) fn bits(word: u32, low: u32, count: u32) -> u32 {
    (word >> low) & ((1 << count) - 1)
}

/// The register number in the `count` bits of `word` from `low` on.
pub(super) fn reg(word: u32, low: u32, count: u32) -> u8 {
    bits(word, low, count) as u8
}

pub(super) fn sign_extend(value: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    (((value << unused) as i32) >> unused) as u32
}

/// DecodeImmShift (A7.4.2): the kind and the distance.
pub(super) fn immediate_shift(kind: u32, amount: u32) -> (Shift, u8) {
    match (kind, amount) {
        (0, amount) => (Shift::Lsl, amount as u8),
        (1, 0) => (Shift::Lsr, 32),
        (1, amount) => (Shift::Lsr, amount as u8),
        (2, 0) => (Shift::Asr, 32),
        (2, amount) => (Shift::Asr, amount as u8),
        (_, 0) => (Shift::Rrx, 1),
        (_, amount) => (Shift::Ror, amount as u8),
    }
}

/// The offset of BL and B.W (A7.7.12, encoding T4).
pub(super) fn long_offset(first: u32, second: u32) -> u32 {
    let s = bits(first, 10, 1);
    let i1 = 1 ^ bits(second, 13, 1) ^ s;
    let i2 = 1 ^ bits(second, 11, 1) ^ s;
    let offset = s << 24 | i1 << 23 | i2 << 22 | bits(first, 0, 10) << 12 | bits(second, 0, 11) << 1;
    sign_extend(offset, 25)
}
