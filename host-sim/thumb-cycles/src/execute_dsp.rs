//! What saturating and DSP instructions do to registers (DDI 0403, A7.7).

use crate::arith::{half, parallel, saturate_signed, saturate_unsigned, shift};
use crate::cpu::Cpu;
use crate::insn::{Insn, Op};

impl Cpu {
    /// Sets d to a saturated value, and Q where it was saturated.
    fn set_saturated(&mut self, insn: &Insn, (value, saturated): (u32, bool)) {
        self.set_reg(insn.d, value);
        self.flags.q |= saturated;
    }

    /// Sets d to a sum of products, and Q where it does not fit a signed word.
    fn set_sum(&mut self, insn: &Insn, value: i64) {
        self.set_reg(insn.d, value as u32);
        self.flags.q |= i32::try_from(value).is_err();
    }

    pub(crate) fn dsp(&mut self, insn: &Insn) {
        let (n, m) = (self.reg(insn.n), self.reg(insn.m));
        let accumulator = if insn.a == 15 { 0 } else { i64::from(self.reg(insn.a) as i32) };
        let long = (u64::from(self.reg(insn.a)) << 32 | u64::from(self.reg(insn.d))) as i64;
        let flag = insn.imm & 1 != 0;
        let swapped = if flag { m.rotate_right(16) } else { m };
        let low = i64::from(half(n, false)) * i64::from(half(swapped, false));
        let high = i64::from(half(n, true)) * i64::from(half(swapped, true));
        let set_long = |cpu: &mut Self, value: i64| {
            cpu.set_reg(insn.d, value as u32);
            cpu.set_reg(insn.a, (value >> 32) as u32);
        };
        match insn.op {
            Op::Ssat | Op::Usat => {
                let value = shift(n, insn.shift, u32::from(insn.amount), false).0;
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
                self.set_reg(insn.d, (rounded >> 32) as u32);
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
                self.set_reg(insn.d, sum.wrapping_add(accumulator as u32));
            }
            Op::Pkh => {
                let shifted = shift(m, insn.shift, u32::from(insn.amount), false).0;
                let value = if flag {
                    (n & 0xffff_0000) | (shifted & 0xffff)
                } else {
                    (shifted & 0xffff_0000) | (n & 0xffff)
                };
                self.set_reg(insn.d, value);
            }
            Op::Parallel => {
                let (value, ge) = parallel(insn.imm, n, m);
                self.set_reg(insn.d, value);
                if let Some(ge) = ge {
                    self.flags.ge = ge;
                }
            }
            Op::Sel => {
                let value = (0..4).fold(0, |value, lane| {
                    let source = if self.flags.ge & 1 << lane != 0 { n } else { m };
                    value | (source & 0xff << (lane * 8))
                });
                self.set_reg(insn.d, value);
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
