//! What each instruction does to registers (DDI 0403, A7.7). Memory and control flow are in `transfer`.

use crate::arith::{
    add_with_carry, half, parallel, saturate_signed, saturate_unsigned, shift, shift as shift_value,
};
use crate::insn::{Insn, Op, Src};
use crate::machine::{Machine, Outcome, Trap};

impl Machine {
    #[inline]
    fn reg(&self, register: u8) -> u32 {
        self.cpu.r[usize::from(register & 15)]
    }

    #[inline]
    fn set(&mut self, register: u8, value: u32) {
        self.cpu.r[usize::from(register & 15)] = value;
    }

    /// The second operand, and the carry that it makes.
    #[inline]
    fn operand(&self, insn: &Insn) -> (u32, bool) {
        let carry = self.cpu.flags.c;
        match insn.src {
            Src::Imm => (insn.imm, carry),
            Src::ImmRotated => (insn.imm, insn.imm >> 31 != 0),
            Src::Reg => (self.reg(insn.m), carry),
            Src::Shifted => shift(self.reg(insn.m), insn.shift, u32::from(insn.amount), carry),
        }
    }

    #[inline]
    fn set_nz(&mut self, value: u32) {
        self.cpu.flags.n = value >> 31 != 0;
        self.cpu.flags.z = value == 0;
    }

    #[inline]
    fn logical(&mut self, insn: &Insn, value: u32, carry: bool) {
        self.set(insn.d, value);
        if insn.s {
            self.set_nz(value);
            self.cpu.flags.c = carry;
        }
    }

    #[inline]
    fn sum(&mut self, insn: &Insn, x: u32, y: u32, carry: bool) {
        let (value, c, v) = add_with_carry(x, y, carry);
        self.set(insn.d, value);
        if insn.s {
            self.set_nz(value);
            self.cpu.flags.c = c;
            self.cpu.flags.v = v;
        }
    }

    #[inline]
    fn compare(&mut self, x: u32, y: u32, carry: bool) {
        let (value, c, v) = add_with_carry(x, y, carry);
        self.set_nz(value);
        self.cpu.flags.c = c;
        self.cpu.flags.v = v;
    }

    /// Carries an instruction out whose condition holds.
    #[inline]
    pub(crate) fn execute(&mut self, insn: &Insn, outcome: &mut Outcome) -> Result<(), Trap> {
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
                self.sum(insn, self.reg(insn.n), y, self.cpu.flags.c);
            }
            Op::Sbc => {
                let y = self.operand(insn).0;
                self.sum(insn, self.reg(insn.n), !y, self.cpu.flags.c);
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
                self.cpu.flags.c = carry;
            }
            Op::LslReg | Op::LsrReg | Op::AsrReg | Op::RorReg => self.shift_by_register(insn),
            Op::Mul => {
                let value = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set(insn.d, value);
                if insn.s {
                    self.set_nz(value);
                }
            }
            Op::Mla => {
                let product = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set(insn.d, self.reg(insn.a).wrapping_add(product));
            }
            Op::Mls => {
                let product = self.reg(insn.n).wrapping_mul(self.reg(insn.m));
                self.set(insn.d, self.reg(insn.a).wrapping_sub(product));
            }
            Op::Umull | Op::Smull | Op::Umlal | Op::Smlal | Op::Umaal => self.product(insn, outcome),
            Op::Sdiv | Op::Udiv => self.divide(insn, outcome),
            Op::Sxtb | Op::Sxth | Op::Uxtb | Op::Uxth | Op::Sxtb16 | Op::Uxtb16 => self.extend(insn),
            Op::Ubfx | Op::Sbfx | Op::Bfi | Op::Movt => self.bit_field(insn),
            Op::Clz => self.set(insn.d, self.reg(insn.m).leading_zeros()),
            Op::Rbit => self.set(insn.d, self.reg(insn.m).reverse_bits()),
            Op::Rev => self.set(insn.d, self.reg(insn.m).swap_bytes()),
            Op::Rev16 => self.set(insn.d, self.reg(insn.m).swap_bytes().rotate_right(16)),
            Op::Revsh => self.set(insn.d, i32::from((self.reg(insn.m) as i16).swap_bytes()) as u32),
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
            _ => return self.transfer_or_branch(insn, outcome),
        }
        Ok(())
    }

    #[inline]
    fn shift_by_register(&mut self, insn: &Insn) {
        use crate::insn::Shift;
        let kind = match insn.op {
            Op::LslReg => Shift::Lsl,
            Op::LsrReg => Shift::Lsr,
            Op::AsrReg => Shift::Asr,
            _ => Shift::Ror,
        };
        let amount = self.reg(insn.m) & 0xff;
        let (value, carry) = shift_value(self.reg(insn.n), kind, amount, self.cpu.flags.c);
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
        self.set(insn.d, value as u32);
        self.set(insn.a, (value >> 32) as u32);
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
        self.set(insn.d, value);
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
        self.set(insn.d, value);
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
        self.set(insn.d, value);
    }

    /// Sets d to a saturated value, and Q where it was saturated.
    fn set_saturated(&mut self, insn: &Insn, (value, saturated): (u32, bool)) {
        self.set(insn.d, value);
        self.cpu.flags.q |= saturated;
    }

    /// Sets d to a sum of products, and Q where it does not fit a signed word.
    fn set_sum(&mut self, insn: &Insn, value: i64) {
        self.set(insn.d, value as u32);
        self.cpu.flags.q |= i32::try_from(value).is_err();
    }

    fn dsp(&mut self, insn: &Insn) {
        let (n, m) = (self.reg(insn.n), self.reg(insn.m));
        let accumulator = if insn.a == 15 { 0 } else { i64::from(self.reg(insn.a) as i32) };
        let long = (u64::from(self.reg(insn.a)) << 32 | u64::from(self.reg(insn.d))) as i64;
        let flag = insn.imm & 1 != 0;
        let swapped = if flag { m.rotate_right(16) } else { m };
        let low = i64::from(half(n, false)) * i64::from(half(swapped, false));
        let high = i64::from(half(n, true)) * i64::from(half(swapped, true));
        let set_long = |machine: &mut Self, value: i64| {
            machine.set(insn.d, value as u32);
            machine.set(insn.a, (value >> 32) as u32);
        };
        match insn.op {
            Op::Ssat | Op::Usat => {
                let value = shift_value(n, insn.shift, u32::from(insn.amount), false).0;
                let value = i64::from(value as i32);
                let result = if insn.op == Op::Ssat {
                    saturate_signed(value, insn.imm)
                } else {
                    saturate_unsigned(value, insn.imm)
                };
                self.set_saturated(insn, result);
            }
            Op::Ssat16 | Op::Usat16 => {
                let lane = |top: bool| {
                    let value = i64::from(half(n, top));
                    if insn.op == Op::Ssat16 {
                        saturate_signed(value, insn.imm)
                    } else {
                        saturate_unsigned(value, insn.imm)
                    }
                };
                let ((low, first), (high, second)) = (lane(false), lane(true));
                self.set_saturated(insn, (low & 0xffff | high << 16, first | second));
            }
            Op::Smlaxy => {
                let product = i64::from(half(n, insn.imm & 2 != 0)) * i64::from(half(m, flag));
                self.set_sum(insn, product + accumulator);
            }
            Op::Smlaw => {
                let product = (i64::from(n as i32) * i64::from(half(m, flag))) >> 16;
                self.set_sum(insn, product + accumulator);
            }
            Op::Smlad => self.set_sum(insn, low + high + accumulator),
            Op::Smlsd => self.set_sum(insn, low - high + accumulator),
            Op::Smmla | Op::Smmls => {
                let product = i64::from(n as i32) * i64::from(m as i32);
                let base = accumulator << 32;
                let value = if insn.op == Op::Smmla {
                    base.wrapping_add(product)
                } else {
                    base.wrapping_sub(product)
                };
                let rounded = if flag { value.wrapping_add(0x8000_0000) } else { value };
                self.set(insn.d, (rounded >> 32) as u32);
            }
            Op::Smlalxy => {
                let product = i64::from(half(n, insn.imm & 2 != 0)) * i64::from(half(m, flag));
                set_long(self, long.wrapping_add(product));
            }
            Op::Smlald => set_long(self, long.wrapping_add(low + high)),
            Op::Smlsld => set_long(self, long.wrapping_add(low - high)),
            Op::Usada8 => {
                let difference = |at: u32| u32::from(((n >> at) as u8).abs_diff((m >> at) as u8));
                let sum: u32 = [0, 8, 16, 24].into_iter().map(difference).sum();
                self.set(insn.d, sum.wrapping_add(accumulator as u32));
            }
            Op::Pkh => {
                let shifted = shift_value(m, insn.shift, u32::from(insn.amount), false).0;
                let value = if flag {
                    (n & 0xffff_0000) | (shifted & 0xffff)
                } else {
                    (shifted & 0xffff_0000) | (n & 0xffff)
                };
                self.set(insn.d, value);
            }
            Op::Parallel => {
                let (value, ge) = parallel(insn.imm, n, m);
                self.set(insn.d, value);
                if let Some(ge) = ge {
                    self.cpu.flags.ge = ge;
                }
            }
            Op::Sel => {
                let value = (0..4).fold(0, |value, lane| {
                    let source = if self.cpu.flags.ge & 1 << lane != 0 { n } else { m };
                    value | (source & 0xff << (lane * 8))
                });
                self.set(insn.d, value);
            }
            // QADD and the others take m first: d = m + n.
            _ => {
                let (x, y) = (i64::from(m as i32), i64::from(n as i32));
                let (doubled, saturated) = match insn.op {
                    Op::Qdadd | Op::Qdsub => {
                        let (value, saturated) = saturate_signed(2 * y, 32);
                        (i64::from(value as i32), saturated)
                    }
                    _ => (y, false),
                };
                let value = match insn.op {
                    Op::Qadd | Op::Qdadd => x + doubled,
                    _ => x - doubled,
                };
                let (value, again) = saturate_signed(value, 32);
                self.set_saturated(insn, (value, saturated | again));
            }
        }
    }
}
