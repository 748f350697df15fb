//! 32-bit instructions on registers alone (A5.3.12 to A5.3.17): shifts, extends, multiplies and the DSP extension.

use super::fields::{bits, reg, undefined};
use crate::insn::{Arch, Class, Insn, Op};

fn alu(op: Op) -> Insn {
    Insn::new(op, Class::Alu, 4)
}

/// Shifts by register, extends, parallel and miscellaneous operations.
pub(super) fn registers(arch: Arch, first: u32, second: u32) -> Insn {
    let (n, d, m) = (reg(first, 0, 4), reg(second, 8, 4), reg(second, 0, 4));
    let (op1, op2) = (bits(first, 4, 4), bits(second, 4, 4));
    let dsp = arch >= Arch::V7EM;
    if second & 0xf000 != 0xf000 || d == 15 || d == 13 || m == 15 || m == 13 {
        return undefined(4);
    }
    if op1 < 8 && op2 == 0 {
        let op = [Op::LslReg, Op::LsrReg, Op::AsrReg, Op::RorReg][(op1 >> 1) as usize];
        return Insn { d, n, m, s: op1 & 1 != 0, ..alu(op) };
    }
    if op1 < 8 && op2 & 8 != 0 {
        let op = match op1 {
            0 => Op::Sxth,
            1 => Op::Uxth,
            2 if dsp => Op::Sxtb16,
            3 if dsp => Op::Uxtb16,
            4 => Op::Sxtb,
            5 => Op::Uxtb,
            _ => return undefined(4),
        };
        if n != 15 && !dsp || second & 0x40 != 0 {
            return undefined(4);
        }
        let class = if n == 15 { Class::Alu } else { Class::MultiplyAccumulate };
        return Insn { d, n, m, amount: (bits(second, 4, 2) * 8) as u8, ..Insn::new(op, class, 4) };
    }
    if n == 15 || n == 13 {
        return undefined(4);
    }
    if op1 & 8 != 0 && op2 < 8 {
        let operation = match op1 & 7 {
            0 => 0, // 8-bit add
            1 => 1, // 16-bit add
            2 => 2, // add, subtract, exchanged
            4 => 3, // 8-bit subtract
            5 => 4, // 16-bit subtract
            6 => 5, // subtract, add, exchanged
            _ => return undefined(4),
        };
        if !dsp || op2 & 3 == 3 {
            return undefined(4);
        }
        return Insn { d, n, m, imm: operation * 8 + op2, ..alu(Op::Parallel) };
    }
    let op = match (op1, op2) {
        (8, 8) if dsp => Op::Qadd,
        (8, 9) if dsp => Op::Qdadd,
        (8, 10) if dsp => Op::Qsub,
        (8, 11) if dsp => Op::Qdsub,
        (9, 8) => Op::Rev,
        (9, 9) => Op::Rev16,
        (9, 10) => Op::Rbit,
        (9, 11) => Op::Revsh,
        (10, 8) if dsp => Op::Sel,
        (11, 8) => Op::Clz,
        _ => return undefined(4),
    };
    if matches!(op, Op::Rev | Op::Rev16 | Op::Rbit | Op::Revsh | Op::Clz) {
        // Both register fields name the operand.
        return if n == m { Insn { d, m, ..alu(op) } } else { undefined(4) };
    }
    Insn { d, n, m, ..alu(op) }
}

/// 32-bit products.
pub(super) fn multiply(arch: Arch, first: u32, second: u32) -> Insn {
    let (n, a, d, m) = (reg(first, 0, 4), reg(second, 12, 4), reg(second, 8, 4), reg(second, 0, 4));
    let (op1, op2) = (bits(first, 4, 3), bits(second, 4, 2));
    if second & 0xc0 != 0 || [n, m, d].iter().any(|&register| register == 15 || register == 13) {
        return undefined(4);
    }
    let class = if a == 15 { Class::Multiply } else { Class::MultiplyAccumulate };
    let insn = |op, imm| Insn { d, n, m, a, imm, ..Insn::new(op, class, 4) };
    if op1 == 0 {
        return match op2 {
            0 if a == 15 => insn(Op::Mul, 0),
            0 => insn(Op::Mla, 0),
            1 if a != 15 => insn(Op::Mls, 0),
            _ => undefined(4),
        };
    }
    if arch < Arch::V7EM {
        return undefined(4);
    }
    match (op1, op2) {
        (1, half) => insn(Op::Smlaxy, half),
        (2, swap @ (0 | 1)) => insn(Op::Smlad, swap),
        (3, half @ (0 | 1)) => insn(Op::Smlaw, half),
        (4, swap @ (0 | 1)) => insn(Op::Smlsd, swap),
        (5, round @ (0 | 1)) => insn(Op::Smmla, round),
        (6, round @ (0 | 1)) if a != 15 => insn(Op::Smmls, round),
        (7, 0) => insn(Op::Usada8, 0),
        _ => undefined(4),
    }
}

/// 64-bit products and divides.
pub(super) fn multiply_long(arch: Arch, first: u32, second: u32) -> Insn {
    let (n, low, high, m) = (reg(first, 0, 4), reg(second, 12, 4), reg(second, 8, 4), reg(second, 0, 4));
    let (op1, op2) = (bits(first, 4, 3), bits(second, 4, 4));
    let dsp = arch >= Arch::V7EM;
    let bad = |register: u8| register == 15 || register == 13;
    if bad(n) || bad(m) || bad(high) {
        return undefined(4);
    }
    if op2 == 15 && low == 15 && (op1 == 1 || op1 == 3) {
        let op = if op1 == 1 { Op::Sdiv } else { Op::Udiv };
        return Insn { d: high, n, m, ..Insn::new(op, Class::Divide, 4) };
    }
    if bad(low) || low == high {
        return undefined(4);
    }
    let insn = |op, class, imm| Insn { d: low, a: high, n, m, imm, ..Insn::new(op, class, 4) };
    let accumulate = Class::MultiplyAccumulateLong;
    match (op1, op2) {
        (0, 0) => insn(Op::Smull, Class::MultiplyLong, 0),
        (2, 0) => insn(Op::Umull, Class::MultiplyLong, 0),
        (4, 0) => insn(Op::Smlal, accumulate, 0),
        (4, half @ 8..=11) if dsp => insn(Op::Smlalxy, accumulate, half & 3),
        (4, swap @ (12 | 13)) if dsp => insn(Op::Smlald, accumulate, swap & 1),
        (5, swap @ (12 | 13)) if dsp => insn(Op::Smlsld, accumulate, swap & 1),
        (6, 0) => insn(Op::Umlal, accumulate, 0),
        (6, 6) if dsp => insn(Op::Umaal, accumulate, 0),
        _ => undefined(4),
    }
}
