//! What each instruction does to registers (DDI 0403, A7.7). Memory, control flow and the state of the core are in
//! `transfer` and `system`.

use crate::arith::{add_with_carry, shift};
use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::insn::{Insn, Op, Shift, Src};
use crate::outcome::Outcome;
use crate::trap::Trap;

impl Cpu {
    /// The second operand, and the carry that it makes.
    #[inline]
    fn operand(&self, insn: &Insn) -> (u32, bool) {
        let carry = self.flags.c;
        match insn.src {
            Src::Imm => (insn.imm, carry),
            Src::ImmRotated => (insn.imm, insn.imm >> 31 != 0),
            Src::Reg => (self.reg(insn.m), carry),
            Src::Shifted => shift(self.reg(insn.m), insn.shift, u32::from(insn.amount), carry),
        }
    }

    #[inline]
    fn logical(&mut self, insn: &Insn, value: u32, carry: bool) {
        self.set_reg(insn.d, value);
        if insn.s {
            self.set_nz(value);
            self.flags.c = carry;
        }
    }

    #[inline]
    fn sum(&mut self, insn: &Insn, x: u32, y: u32, carry: bool) {
        let (value, c, v) = add_with_carry(x, y, carry);
        self.set_reg(insn.d, value);
        if insn.s {
            self.set_nz(value);
            self.flags.c = c;
            self.flags.v = v;
        }
    }

    #[inline]
    fn compare(&mut self, x: u32, y: u32, carry: bool) {
        let (value, c, v) = add_with_carry(x, y, carry);
        self.set_nz(value);
        self.flags.c = c;
        self.flags.v = v;
    }

    /// Carries an instruction out whose condition holds.
    #[inline]
    pub(crate) fn execute(&mut self, insn: &Insn, bus: &mut Bus, outcome: &mut Outcome) -> Result<(), Trap> {
        match insn.op {
            Op::Mov => {
                let (value, carry) = self.operand(insn);
                self.logical(insn, value, carry);
            }
            Op::Add => {
                let y = self.operand(insn).0;
                self.sum(insn, self.reg(insn.n), y, false);
            }
            Op::Sub => {
                let y = self.operand(insn).0;
                self.sum(insn, self.reg(insn.n), !y, true);
            }
            Op::Cmp => {
                let y = self.operand(insn).0;
                self.compare(self.reg(insn.n), !y, true);
            }
            Op::Cmn => {
                let y = self.operand(insn).0;
                self.compare(self.reg(insn.n), y, false);
            }
            Op::Adc => {
                let y = self.operand(insn).0;
                self.sum(insn, self.reg(insn.n), y, self.flags.c);
            }
            Op::Sbc => {
                let y = self.operand(insn).0;
                self.sum(insn, self.reg(insn.n), !y, self.flags.c);
            }
            Op::Rsb => {
                let y = self.operand(insn).0;
                self.sum(insn, !self.reg(insn.n), y, true);
            }
            Op::And => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, self.reg(insn.n) & y, carry);
            }
            Op::Orr => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, self.reg(insn.n) | y, carry);
            }
            Op::Eor => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, self.reg(insn.n) ^ y, carry);
            }
            Op::Bic => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, self.reg(insn.n) & !y, carry);
            }
            Op::Orn => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, self.reg(insn.n) | !y, carry);
            }
            Op::Mvn => {
                let (y, carry) = self.operand(insn);
                self.logical(insn, !y, carry);
            }
            Op::Tst | Op::Teq => {
                let (y, carry) = self.operand(insn);
                let x = self.reg(insn.n);
                self.set_nz(if insn.op == Op::Tst { x & y } else { x ^ y });
                self.flags.c = carry;
            }
            Op::LslReg | Op::LsrReg | Op::AsrReg | Op::RorReg => self.shift_by_register(insn),
            Op::Mul => {
                let value = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set_reg(insn.d, value);
                if insn.s {
                    self.set_nz(value);
                }
            }
            Op::Mla => {
                let product = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set_reg(insn.d, self.reg(insn.a).wrapping_add(product));
            }
            Op::Mls => {
                let product = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set_reg(insn.d, self.reg(insn.a).wrapping_sub(product));
            }
            Op::Umull | Op::Smull | Op::Umlal | Op::Smlal | Op::Umaal => self.product(insn, outcome),
            Op::Sdiv | Op::Udiv => self.divide(insn, outcome),
            Op::Sxtb | Op::Sxth | Op::Uxtb | Op::Uxth | Op::Sxtb16 | Op::Uxtb16 => self.extend(insn),
            Op::Ubfx | Op::Sbfx | Op::Bfi | Op::Movt => self.bit_field(insn),
            Op::Clz => self.set_reg(insn.d, self.reg(insn.m).leading_zeros()),
            Op::Rbit => self.set_reg(insn.d, self.reg(insn.m).reverse_bits()),
            Op::Rev => self.set_reg(insn.d, self.reg(insn.m).swap_bytes()),
            Op::Rev16 => self.set_reg(insn.d, self.reg(insn.m).swap_bytes().rotate_right(16)),
            Op::Revsh => self.set_reg(insn.d, i32::from((self.reg(insn.m) as i16).swap_bytes()) as u32),
            Op::Ssat
            | Op::Usat
            | Op::Ssat16
            | Op::Usat16
            | Op::Smlaxy
            | Op::Smlaw
            | Op::Smlad
            | Op::Smlsd
            | Op::Smmla
            | Op::Smmls
            | Op::Smlalxy
            | Op::Smlald
            | Op::Smlsld
            | Op::Usada8
            | Op::Pkh
            | Op::Parallel
            | Op::Qadd
            | Op::Qsub
            | Op::Qdadd
            | Op::Qdsub
            | Op::Sel => self.dsp(insn),
            _ => return self.transfer_or_branch(insn, bus, outcome),
        }
        Ok(())
    }

    #[inline]
    fn shift_by_register(&mut self, insn: &Insn) {
        let kind = match insn.op {
            Op::LslReg => Shift::Lsl,
            Op::LsrReg => Shift::Lsr,
            Op::AsrReg => Shift::Asr,
            _ => Shift::Ror,
        };
        let amount = self.reg(insn.m) & 0xff;
        let (value, carry) = shift(self.reg(insn.n), kind, amount, self.flags.c);
        self.logical(insn, value, carry);
    }

    #[inline]
    fn product(&mut self, insn: &Insn, outcome: &mut Outcome) {
        let (n, m) = (self.reg(insn.n), self.reg(insn.m));
        (outcome.x, outcome.y) = (n, m);
        let unsigned = u64::from(n) * u64::from(m);
        let signed = i64::from(n as i32).wrapping_mul(i64::from(m as i32)) as u64;
        let (low, high) = (u64::from(self.reg(insn.d)), u64::from(self.reg(insn.a)));
        let value = match insn.op {
            Op::Umull => unsigned,
            Op::Smull => signed,
            Op::Umlal => unsigned.wrapping_add(high << 32 | low),
            Op::Smlal => signed.wrapping_add(high << 32 | low),
            _ => unsigned.wrapping_add(low).wrapping_add(high),
        };
        self.set_reg(insn.d, value as u32);
        self.set_reg(insn.a, (value >> 32) as u32);
    }

    fn divide(&mut self, insn: &Insn, outcome: &mut Outcome) {
        let (n, m) = (self.reg(insn.n), self.reg(insn.m));
        // A division by zero gives zero unless CCR.DIV_0_TRP, which nothing here sets.
        let value = if insn.op == Op::Sdiv {
            (outcome.x, outcome.y) = ((n as i32).unsigned_abs(), (m as i32).unsigned_abs());
            if m == 0 { 0 } else { (n as i32).wrapping_div(m as i32) as u32 }
        } else {
            (outcome.x, outcome.y) = (n, m);
            n.checked_div(m).unwrap_or(0)
        };
        self.set_reg(insn.d, value);
    }

    #[inline]
    fn extend(&mut self, insn: &Insn) {
        let word = self.reg(insn.m).rotate_right(u32::from(insn.amount));
        let base = if insn.n == 15 { 0 } else { self.reg(insn.n) };
        let lanes =
            |low: u32, high: u32| (base.wrapping_add(low) & 0xffff) | (base >> 16).wrapping_add(high) << 16;
        let value = match insn.op {
            Op::Sxtb => base.wrapping_add(i32::from(word as i8) as u32),
            Op::Sxth => base.wrapping_add(i32::from(word as i16) as u32),
            Op::Uxtb => base.wrapping_add(word & 0xff),
            Op::Uxth => base.wrapping_add(word & 0xffff),
            Op::Sxtb16 => lanes(i32::from(word as i8) as u32, i32::from((word >> 16) as i8) as u32),
            _ => lanes(word & 0xff, word >> 16 & 0xff),
        };
        self.set_reg(insn.d, value);
    }

    #[inline]
    fn bit_field(&mut self, insn: &Insn) {
        let lsb = u32::from(insn.amount);
        let value = match insn.op {
            Op::Ubfx => {
                let unused = 32 - insn.imm;
                (self.reg(insn.n) >> lsb) << unused >> unused
            }
            Op::Sbfx => {
                let unused = 32 - insn.imm;
                (((self.reg(insn.n) >> lsb) << unused) as i32 >> unused) as u32
            }
            Op::Movt => (self.reg(insn.d) & 0xffff) | insn.imm << 16,
            _ => {
                let source = if insn.n == 15 { 0 } else { self.reg(insn.n) };
                (self.reg(insn.d) & !insn.imm) | ((source << lsb) & insn.imm)
            }
        };
        self.set_reg(insn.d, value);
    }
}
