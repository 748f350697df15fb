//! 32-bit instructions (A5.3): data processing, loads and stores.

use super::fields::{bits, immediate_shift, reg, undefined};
use super::{dsp, system};
use crate::insn::{Arch, Class, Index, Insn, Op, Shift, Src};

fn alu(op: Op) -> Insn {
    Insn::new(op, Class::Alu, 4)
}

pub(super) fn decode(arch: Arch, pc: u32, first: u32, second: u32) -> Insn {
    if arch == Arch::V6M {
        return system::decode_v6m(pc, first, second);
    }
    match (bits(first, 11, 2), bits(first, 4, 7)) {
        (1, op) if op & 0b1100100 == 0b0000000 => multiple(first, second),
        (1, op) if op & 0b1100100 == 0b0000100 => dual(arch, pc, first, second),
        (1, op) if op & 0b1100000 == 0b0100000 => shifted_register(arch, first, second),
        (2, _) if second & 0x8000 != 0 => system::decode(arch, pc, first, second),
        (2, op) if op & 0b0100000 == 0 => modified_constant(first, second),
        (2, _) => plain_constant(arch, pc, first, second),
        (3, op) if op & 0b1110001 == 0 => single(pc, first, second),
        (3, op) if op & 0b1100001 == 0b0000001 => single(pc, first, second),
        (3, op) if op & 0b1110000 == 0b0100000 => dsp::registers(arch, first, second),
        (3, op) if op & 0b1111000 == 0b0110000 => dsp::multiply(arch, first, second),
        (3, op) if op & 0b1111000 == 0b0111000 => dsp::multiply_long(arch, first, second),
        _ => Insn::new(Op::Coprocessor, Class::Control, 4),
    }
}

/// Registers that most 32-bit instructions do not take.
fn sp_or_pc(register: u8) -> bool {
    register == 13 || register == 15
}

/// LDM, STM (A5.3.5).
fn multiple(first: u32, second: u32) -> Insn {
    let (n, list, load) = (reg(first, 0, 4), second & 0xffff, first & 1 << 4 != 0);
    let amount = match bits(first, 7, 2) {
        1 => 0,
        2 => 1,
        _ => return undefined(4),
    };
    // The sp is in no list; the pc and the lr not both in one that is loaded, and only loaded.
    let wrong = if load { list & 0xc000 == 0xc000 } else { list & 0x8000 != 0 };
    if n == 15 || list.count_ones() < 2 || list & 1 << 13 != 0 || wrong {
        return undefined(4);
    }
    let (op, class) = if load { (Op::Ldm, Class::LoadMultiple) } else { (Op::Stm, Class::StoreMultiple) };
    Insn { n, imm: list, amount, s: first & 1 << 5 != 0, ..Insn::new(op, class, 4) }
}

/// LDRD, STRD, exclusives, acquire and release, TBB (A5.3.6).
fn dual(arch: Arch, pc: u32, first: u32, second: u32) -> Insn {
    let (n, t, t2) = (reg(first, 0, 4), reg(second, 12, 4), reg(second, 8, 4));
    let (up, load) = (first & 1 << 7 != 0, first & 1 << 4 != 0);
    let offset = bits(second, 0, 8) << 2;
    let (pre, write_back) = (first & 1 << 8 != 0, first & 1 << 5 != 0);
    if pre || write_back {
        let imm = if up { offset } else { offset.wrapping_neg() };
        let (index, imm) = match (pre, write_back) {
            (true, false) if n == 15 => (Index::Literal, (pc & !3).wrapping_add(4).wrapping_add(imm)),
            (true, false) => (Index::Offset, imm),
            (true, true) => (Index::Pre, imm),
            _ => (Index::Post, imm),
        };
        let (op, class) = if load { (Op::Ldrd, Class::LoadDouble) } else { (Op::Strd, Class::StoreDouble) };
        if arch == Arch::V8M && first == 0xe97f && second == 0xe97f {
            return Insn::new(Op::Nop, Class::Nop, 4); // SG in the secure state
        }
        if n == 15 && (write_back || !load) || t == 13 || t2 == 13 || t == 15 || t2 == 15 {
            return undefined(4);
        }
        return Insn { d: t, a: t2, n, imm, index, ..Insn::new(op, class, 4) };
    }
    let exclusive = |bytes: u8, imm: u32| {
        if load {
            Insn { d: t, n, imm, amount: bytes, s: true, ..Insn::new(Op::LoadAcquire, Class::Load, 4) }
        } else {
            Insn { a: t, n, imm, amount: bytes, s: true, ..Insn::new(Op::StoreRelease, Class::Store, 4) }
        }
    };
    let table_branch = up && load && bits(second, 5, 3) == 0;
    if n == 15 && !table_branch {
        return undefined(4);
    }
    if !up {
        return match (load, t) {
            (true, _) if t2 == 15 && !sp_or_pc(t) => exclusive(4, offset),
            (false, 15) if arch == Arch::V8M => Insn { d: t2, ..alu(Op::Tt) },
            (false, _) if !sp_or_pc(t) && !sp_or_pc(t2) && t2 != t && t2 != n => {
                Insn { d: t2, ..exclusive(4, offset) }
            }
            _ => undefined(4),
        };
    }
    let status = reg(second, 0, 4);
    let kind = bits(second, 4, 4);
    if kind >= 2 {
        // A second register is not there, and neither is a status unless the store is exclusive.
        let with_status = !load && !(8..12).contains(&kind);
        let status_fits =
            if with_status { !sp_or_pc(status) && status != t && status != n } else { status == 15 };
        if t2 != 15 || sp_or_pc(t) || !status_fits {
            return undefined(4);
        }
    }
    match kind {
        0 | 1 if load && t == 15 && t2 == 0 && !sp_or_pc(status) => {
            let op = if kind == 0 { Op::Tbb } else { Op::Tbh };
            Insn { n, m: status, ..Insn::new(op, Class::TableBranch, 4) }
        }
        4 | 5 => {
            let bytes = if kind == 4 { 1 } else { 2 };
            if load { exclusive(bytes, 0) } else { Insn { d: status, ..exclusive(bytes, 0) } }
        }
        8..=10 | 12..=14 if arch == Arch::V8M => {
            let bytes = 1 << (kind & 3);
            let insn = Insn { s: kind >= 12, ..exclusive(bytes, 0) };
            if load || kind < 12 { insn } else { Insn { d: status, ..insn } }
        }
        _ => undefined(4),
    }
}

/// The data processing operation with this number (A5.3.1, A5.3.11), and whether its result is kept.
fn operation(number: u32, n: u8, d: u8) -> Option<(Op, bool)> {
    let found = match number {
        0 if d == 15 => (Op::Tst, false),
        0 => (Op::And, true),
        1 => (Op::Bic, true),
        2 if n == 15 => (Op::Mov, true),
        2 => (Op::Orr, true),
        3 if n == 15 => (Op::Mvn, true),
        3 => (Op::Orn, true),
        4 if d == 15 => (Op::Teq, false),
        4 => (Op::Eor, true),
        8 if d == 15 => (Op::Cmn, false),
        8 => (Op::Add, true),
        10 => (Op::Adc, true),
        11 => (Op::Sbc, true),
        13 if d == 15 => (Op::Cmp, false),
        13 => (Op::Sub, true),
        14 => (Op::Rsb, true),
        _ => return None,
    };
    Some(found)
}

fn shifted_register(arch: Arch, first: u32, second: u32) -> Insn {
    let (n, d, m) = (reg(first, 0, 4), reg(second, 8, 4), reg(second, 0, 4));
    let s = first & 1 << 4 != 0;
    let number = bits(first, 5, 4);
    if second & 0x8000 != 0 {
        return undefined(4);
    }
    let (shift, amount) = immediate_shift(bits(second, 4, 2), bits(second, 12, 3) << 2 | bits(second, 6, 2));
    let plain = shift == Shift::Lsl && amount == 0;
    if number == 6 {
        if arch < Arch::V7EM
            || s
            || bits(second, 4, 1) != 0
            || [n, d, m].iter().any(|&register| sp_or_pc(register))
        {
            return undefined(4);
        }
        let imm = bits(second, 5, 1);
        let class = if plain { Class::Alu } else { Class::Shifted };
        return Insn { d, n, m, imm, shift, amount, ..Insn::new(Op::Pkh, class, 4) };
    }
    let Some((op, keeps)) = operation(number, n, d).filter(|&(_, keeps)| keeps || s) else {
        return undefined(4);
    };
    if m == 15 || keeps && d == 15 || n == 15 && !matches!(op, Op::Mov | Op::Mvn) {
        return undefined(4);
    }
    // A shift by itself (MOV) has its result as soon as any.
    let class = if plain || op == Op::Mov { Class::Alu } else { Class::Shifted };
    let src = if plain { Src::Reg } else { Src::Shifted };
    let d = if keeps { d } else { 15 };
    Insn { d, n, m, src, shift, amount, s, ..Insn::new(op, class, 4) }
}

/// ThumbExpandImm (A5.3.2): the constant and whether it is a rotated one.
fn expand(imm12: u32) -> (u32, bool) {
    let byte = imm12 & 0xff;
    match imm12 >> 8 {
        0 => (byte, false),
        1 => (byte | byte << 16, false),
        2 => (byte << 8 | byte << 24, false),
        3 => (byte * 0x0101_0101, false),
        _ => ((0x80 | byte & 0x7f).rotate_right(imm12 >> 7), true),
    }
}

fn modified_constant(first: u32, second: u32) -> Insn {
    let (n, d, s) = (reg(first, 0, 4), reg(second, 8, 4), first & 1 << 4 != 0);
    let imm12 = bits(first, 10, 1) << 11 | bits(second, 12, 3) << 8 | bits(second, 0, 8);
    let (imm, rotated) = expand(imm12);
    let Some((op, keeps)) = operation(bits(first, 5, 4), n, d).filter(|&(_, keeps)| keeps || s) else {
        return undefined(4);
    };
    if keeps && d == 15 || n == 15 && !matches!(op, Op::Mov | Op::Mvn) {
        return undefined(4);
    }
    let src = if rotated { Src::ImmRotated } else { Src::Imm };
    let class = if rotated && op != Op::Mov { Class::Shifted } else { Class::Alu };
    let d = if keeps { d } else { 15 };
    Insn { d, n, imm, src, s, ..Insn::new(op, class, 4) }
}

/// A5.3.3.
fn plain_constant(arch: Arch, pc: u32, first: u32, second: u32) -> Insn {
    let (n, d) = (reg(first, 0, 4), reg(second, 8, 4));
    let imm12 = bits(first, 10, 1) << 11 | bits(second, 12, 3) << 8 | bits(second, 0, 8);
    let lsb = bits(second, 12, 3) << 2 | bits(second, 6, 2);
    let low5 = bits(second, 0, 5);
    let here = (pc & !3).wrapping_add(4);
    let wants_zeroes = first & 1 << 8 != 0 && first & 1 << 9 != 0;
    if d == 15 || wants_zeroes && (first & 1 << 10 != 0 || second & 1 << 5 != 0) {
        return undefined(4);
    }
    match bits(first, 4, 5) {
        0b00000 if n == 15 => Insn { d, imm: here.wrapping_add(imm12), ..alu(Op::Mov) },
        0b00000 => Insn { d, n, imm: imm12, ..alu(Op::Add) },
        0b01010 if n == 15 => Insn { d, imm: here.wrapping_sub(imm12), ..alu(Op::Mov) },
        0b01010 => Insn { d, n, imm: imm12, ..alu(Op::Sub) },
        0b00100 => Insn { d, imm: bits(first, 0, 4) << 12 | imm12, ..alu(Op::Mov) },
        0b01100 => Insn { d, imm: bits(first, 0, 4) << 12 | imm12, ..alu(Op::Movt) },
        kind @ (0b10000 | 0b10010 | 0b11000 | 0b11010) => {
            let arithmetic = kind & 2 != 0;
            let signed = kind < 0b11000;
            if arithmetic && lsb == 0 {
                if arch < Arch::V7EM || low5 > 15 {
                    return undefined(4);
                }
                let (op, imm) = if signed { (Op::Ssat16, low5 + 1) } else { (Op::Usat16, low5) };
                return Insn { d, n, imm, ..alu(op) };
            }
            let shift = if arithmetic { Shift::Asr } else { Shift::Lsl };
            let (op, imm) = if signed { (Op::Ssat, low5 + 1) } else { (Op::Usat, low5) };
            Insn { d, n, imm, shift, amount: lsb as u8, ..alu(op) }
        }
        0b10100 | 0b11100 => {
            if lsb + low5 > 31 {
                return undefined(4);
            }
            let op = if bits(first, 7, 1) == 0 { Op::Sbfx } else { Op::Ubfx };
            Insn { d, n, imm: low5 + 1, amount: lsb as u8, ..alu(op) }
        }
        0b10110 => {
            if low5 < lsb {
                return undefined(4);
            }
            let mask = (u32::MAX >> (31 - low5)) & (u32::MAX << lsb);
            Insn { d, n, imm: mask, amount: lsb as u8, ..alu(Op::Bfi) }
        }
        _ => undefined(4),
    }
}

/// Loads and stores of one register (A5.3.7 to A5.3.10).
fn single(pc: u32, first: u32, second: u32) -> Insn {
    let (n, t) = (reg(first, 0, 4), reg(second, 12, 4));
    let (load, signed) = (first & 1 << 4 != 0, first & 1 << 8 != 0);
    let (op, class) = match (load, signed, bits(first, 5, 2)) {
        (true, false, 0) => (Op::Ldrb, Class::Load),
        (true, false, 1) => (Op::Ldrh, Class::Load),
        (true, false, 2) if t == 15 => (Op::LdrPc, Class::Load),
        (true, false, 2) => (Op::Ldr, Class::Load),
        (true, true, 0) => (Op::Ldrsb, Class::Load),
        (true, true, 1) => (Op::Ldrsh, Class::Load),
        (false, false, 0) => (Op::Strb, Class::Store),
        (false, false, 1) => (Op::Strh, Class::Store),
        (false, false, 2) => (Op::Str, Class::Store),
        _ => return undefined(4),
    };
    // Loads of bytes and halfwords to the pc are PLD, PLI and unallocated hints.
    let hint = load && t == 15 && op != Op::LdrPc;
    let insn = |insn: Insn| if hint { Insn::new(Op::Nop, Class::Nop, 4) } else { insn };
    let base = Insn { d: t, n, ..Insn::new(op, class, 4) };
    if n == 15 {
        if !load {
            return undefined(4);
        }
        let offset = bits(second, 0, 12);
        let here = (pc & !3).wrapping_add(4);
        let imm = if first & 1 << 7 != 0 { here.wrapping_add(offset) } else { here.wrapping_sub(offset) };
        return insn(Insn { n: 15, imm, index: Index::Literal, ..base });
    }
    if !load && t == 15 {
        return undefined(4);
    }
    if first & 1 << 7 != 0 {
        return insn(Insn { imm: bits(second, 0, 12), ..base });
    }
    if bits(second, 6, 6) == 0 {
        let m = reg(second, 0, 4);
        if m == 13 || m == 15 {
            return undefined(4);
        }
        return insn(Insn { m, amount: bits(second, 4, 2) as u8, index: Index::Register, ..base });
    }
    if second & 1 << 11 == 0 {
        return undefined(4);
    }
    let offset = bits(second, 0, 8);
    let imm = if second & 1 << 9 != 0 { offset } else { offset.wrapping_neg() };
    let index = match bits(second, 8, 3) {
        // Negative offset, and unprivileged (everything is privileged here).
        0b110 if sp_or_pc(t) => return undefined(4),
        0b100 | 0b110 => Index::Offset,
        0b101 | 0b111 => Index::Pre,
        0b001 | 0b011 => Index::Post,
        _ => return undefined(4),
    };
    if index != Index::Offset && (n == t || hint) {
        return undefined(4);
    }
    insn(Insn { imm, index, ..base })
}
