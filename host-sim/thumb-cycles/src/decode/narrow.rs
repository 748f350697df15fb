//! 16-bit instructions (A5.2).

use super::fields::{bits, immediate_shift, reg, sign_extend, undefined};
use crate::insn::{Arch, Class, Index, Insn, Op, Shift, Src};

fn alu(op: Op) -> Insn {
    Insn::new(op, Class::Alu, 2)
}

/// A load or store of `d` at `n` plus a constant.
fn transfer(op: Op, class: Class, d: u8, n: u8, imm: u32) -> Insn {
    Insn { d, n, imm, ..Insn::new(op, class, 2) }
}

pub(super) fn decode(arch: Arch, pc: u32, word: u32, in_it: bool) -> Insn {
    let s = !in_it;
    match word >> 10 {
        0..=0b001111 => immediate(word, s),
        0b010000 => data(word, s),
        0b010001 => special(arch, word),
        0b010010 | 0b010011 => {
            let imm = (pc & !3).wrapping_add(4).wrapping_add(bits(word, 0, 8) << 2);
            Insn { d: reg(word, 8, 3), imm, index: Index::Literal, ..Insn::new(Op::Ldr, Class::Load, 2) }
        }
        0b010100..=0b010111 => register_transfer(word),
        0b011000..=0b100111 => immediate_transfer(word),
        0b101000 | 0b101001 => {
            let imm = (pc & !3).wrapping_add(4).wrapping_add(bits(word, 0, 8) << 2);
            Insn { d: reg(word, 8, 3), imm, ..alu(Op::Mov) }
        }
        0b101010 | 0b101011 => Insn { d: reg(word, 8, 3), n: 13, imm: bits(word, 0, 8) << 2, ..alu(Op::Add) },
        0b101100..=0b101111 => miscellaneous(arch, pc, word, in_it),
        0b110000..=0b110011 => {
            let (n, list) = (reg(word, 8, 3), bits(word, 0, 8));
            if list == 0 {
                return undefined(2);
            }
            let load = word & 1 << 11 != 0;
            let (op, class) =
                if load { (Op::Ldm, Class::LoadMultiple) } else { (Op::Stm, Class::StoreMultiple) };
            Insn { n, imm: list, s: !load || list & 1 << n == 0, ..Insn::new(op, class, 2) }
        }
        0b110100..=0b110111 => match bits(word, 8, 4) {
            14 => Insn { imm: bits(word, 0, 8), ..undefined(2) },
            15 => Insn { imm: bits(word, 0, 8), ..Insn::new(Op::Svc, Class::Trap, 2) },
            cond => {
                let offset = sign_extend(bits(word, 0, 8) << 1, 9);
                let imm = pc.wrapping_add(4).wrapping_add(offset);
                Insn { cond: cond as u8, imm, ..Insn::new(Op::B, Class::Branch, 2) }
            }
        },
        _ => {
            let offset = sign_extend(bits(word, 0, 11) << 1, 12);
            Insn { imm: pc.wrapping_add(4).wrapping_add(offset), ..Insn::new(Op::B, Class::Branch, 2) }
        }
    }
}

/// Shift, add, subtract, move and compare with constants.
fn immediate(word: u32, s: bool) -> Insn {
    let (low, middle, high) = (reg(word, 0, 3), reg(word, 3, 3), reg(word, 8, 3));
    let imm8 = bits(word, 0, 8);
    match word >> 11 {
        kind @ 0..=2 => {
            let (shift, amount) = immediate_shift(kind, bits(word, 6, 5));
            let src = if kind == 0 && amount == 0 { Src::Reg } else { Src::Shifted };
            Insn { d: low, m: middle, src, shift, amount, s, ..alu(Op::Mov) }
        }
        3 => {
            let op = if word & 1 << 9 == 0 { Op::Add } else { Op::Sub };
            if word & 1 << 10 == 0 {
                Insn { d: low, n: middle, m: reg(word, 6, 3), src: Src::Reg, s, ..alu(op) }
            } else {
                Insn { d: low, n: middle, imm: bits(word, 6, 3), s, ..alu(op) }
            }
        }
        4 => Insn { d: high, imm: imm8, s, ..alu(Op::Mov) },
        5 => Insn { n: high, imm: imm8, s: true, ..alu(Op::Cmp) },
        6 => Insn { d: high, n: high, imm: imm8, s, ..alu(Op::Add) },
        _ => Insn { d: high, n: high, imm: imm8, s, ..alu(Op::Sub) },
    }
}

/// Data processing on low registers (A5.2.2).
fn data(word: u32, s: bool) -> Insn {
    let (d, m) = (reg(word, 0, 3), reg(word, 3, 3));
    let both = |op| Insn { d, n: d, m, src: Src::Reg, s, ..alu(op) };
    let test = |op| Insn { n: d, m, src: Src::Reg, s: true, ..alu(op) };
    match bits(word, 6, 4) {
        0 => both(Op::And),
        1 => both(Op::Eor),
        2 => both(Op::LslReg),
        3 => both(Op::LsrReg),
        4 => both(Op::AsrReg),
        5 => both(Op::Adc),
        6 => both(Op::Sbc),
        7 => both(Op::RorReg),
        8 => test(Op::Tst),
        9 => Insn { d, n: m, imm: 0, s, ..alu(Op::Rsb) },
        10 => test(Op::Cmp),
        11 => test(Op::Cmn),
        12 => both(Op::Orr),
        13 => Insn { d, n: m, m: d, s, ..Insn::new(Op::Mul, Class::Multiply, 2) },
        14 => both(Op::Bic),
        _ => Insn { d, m, src: Src::Reg, s, ..alu(Op::Mvn) },
    }
}

/// Data processing on all registers, and branch and exchange (A5.2.3).
fn special(arch: Arch, word: u32) -> Insn {
    let d = reg(word, 0, 3) | reg(word, 7, 1) << 3;
    let m = reg(word, 3, 4);
    match bits(word, 8, 2) {
        0 if d == 15 => Insn { m, ..Insn::new(Op::AddPc, Class::BranchRegister, 2) },
        0 => Insn { d, n: d, m, src: Src::Reg, ..alu(Op::Add) },
        1 => Insn { n: d, m, src: Src::Reg, s: true, ..alu(Op::Cmp) },
        2 if d == 15 => Insn { m, ..Insn::new(Op::MovPc, Class::BranchRegister, 2) },
        2 => Insn { d, m, src: Src::Reg, ..alu(Op::Mov) },
        _ => {
            // BXNS and BLXNS leave the secure state, which no image of one state has.
            let plain = word & 7 == 0;
            if word & 0x80 == 0 && plain {
                Insn { m, ..Insn::new(Op::Bx, Class::BranchRegister, 2) }
            } else if plain && m != 15 && arch >= Arch::V6M {
                Insn { m, ..Insn::new(Op::BlxReg, Class::CallRegister, 2) }
            } else {
                undefined(2)
            }
        }
    }
}

fn register_transfer(word: u32) -> Insn {
    let (op, class) = match bits(word, 9, 3) {
        0 => (Op::Str, Class::Store),
        1 => (Op::Strh, Class::Store),
        2 => (Op::Strb, Class::Store),
        3 => (Op::Ldrsb, Class::Load),
        4 => (Op::Ldr, Class::Load),
        5 => (Op::Ldrh, Class::Load),
        6 => (Op::Ldrb, Class::Load),
        _ => (Op::Ldrsh, Class::Load),
    };
    Insn {
        d: reg(word, 0, 3),
        n: reg(word, 3, 3),
        m: reg(word, 6, 3),
        index: Index::Register,
        ..Insn::new(op, class, 2)
    }
}

fn immediate_transfer(word: u32) -> Insn {
    let (low, middle, imm5) = (reg(word, 0, 3), reg(word, 3, 3), bits(word, 6, 5));
    match word >> 11 {
        0b01100 => transfer(Op::Str, Class::Store, low, middle, imm5 << 2),
        0b01101 => transfer(Op::Ldr, Class::Load, low, middle, imm5 << 2),
        0b01110 => transfer(Op::Strb, Class::Store, low, middle, imm5),
        0b01111 => transfer(Op::Ldrb, Class::Load, low, middle, imm5),
        0b10000 => transfer(Op::Strh, Class::Store, low, middle, imm5 << 1),
        0b10001 => transfer(Op::Ldrh, Class::Load, low, middle, imm5 << 1),
        0b10010 => transfer(Op::Str, Class::Store, reg(word, 8, 3), 13, bits(word, 0, 8) << 2),
        _ => transfer(Op::Ldr, Class::Load, reg(word, 8, 3), 13, bits(word, 0, 8) << 2),
    }
}

/// A5.2.5.
fn miscellaneous(arch: Arch, pc: u32, word: u32, in_it: bool) -> Insn {
    let v7 = arch >= Arch::V7M;
    let (d, m) = (reg(word, 0, 3), reg(word, 3, 3));
    let unary = |op| Insn { d, m, ..alu(op) };
    match bits(word, 5, 7) {
        0b0000000..=0b0000111 => {
            let op = if word & 0x80 == 0 { Op::Add } else { Op::Sub };
            Insn { d: 13, n: 13, imm: bits(word, 0, 7) << 2, ..alu(op) }
        }
        0b0010000 | 0b0010001 => unary(Op::Sxth),
        0b0010010 | 0b0010011 => unary(Op::Sxtb),
        0b0010100 | 0b0010101 => unary(Op::Uxth),
        0b0010110 | 0b0010111 => unary(Op::Uxtb),
        0b0110011 if arch == Arch::V6M && word & 0xef != 0x62 => undefined(2),
        0b0110011 => {
            // Bit 4 disables; bits 1 and 0 choose PRIMASK and FAULTMASK.
            Insn { imm: bits(word, 0, 5), ..Insn::new(Op::Cps, Class::Control, 2) }
        }
        0b1010000 | 0b1010001 => unary(Op::Rev),
        0b1010010 | 0b1010011 => unary(Op::Rev16),
        0b1010110 | 0b1010111 => unary(Op::Revsh),
        0b1110000..=0b1110111 => Insn { imm: bits(word, 0, 8), ..Insn::new(Op::Bkpt, Class::Trap, 2) },
        0b1111000..=0b1111111 => hint_or_it(arch, word),
        0b0100000..=0b0101111 => {
            let list = bits(word, 0, 8) | bits(word, 8, 1) << 14;
            if list == 0 {
                return undefined(2);
            }
            Insn { n: 13, imm: list, amount: 1, s: true, ..Insn::new(Op::Stm, Class::StoreMultiple, 2) }
        }
        0b1100000..=0b1101111 => {
            let list = bits(word, 0, 8) | bits(word, 8, 1) << 15;
            if list == 0 {
                return undefined(2);
            }
            Insn { n: 13, imm: list, s: true, ..Insn::new(Op::Ldm, Class::LoadMultiple, 2) }
        }
        _ if v7 && !in_it && word & 0x500 == 0x100 => {
            let op = if word & 0x800 == 0 { Op::Cbz } else { Op::Cbnz };
            let offset = bits(word, 3, 5) << 1 | bits(word, 9, 1) << 6;
            let imm = pc.wrapping_add(4).wrapping_add(offset);
            Insn { n: d, imm, ..Insn::new(op, Class::Branch, 2) }
        }
        _ => undefined(2),
    }
}

fn hint_or_it(arch: Arch, word: u32) -> Insn {
    let mask = bits(word, 0, 4);
    if mask != 0 {
        return if arch == Arch::V6M {
            undefined(2)
        } else {
            Insn { imm: bits(word, 0, 8), ..Insn::new(Op::It, Class::It, 2) }
        };
    }
    match bits(word, 4, 4) {
        2 => Insn::new(Op::Wfe, Class::Wait, 2),
        3 => Insn::new(Op::Wfi, Class::Wait, 2),
        4 => Insn::new(Op::Sev, Class::Control, 2),
        _ => Insn { shift: Shift::Lsl, ..Insn::new(Op::Nop, Class::Nop, 2) },
    }
}
