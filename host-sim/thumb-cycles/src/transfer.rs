//! Loads, stores and branches (DDI 0403, A7.7).

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::fault::{AccessError, Cause};
use crate::insn::{Arch, Index, Insn, Op};
use crate::outcome::Outcome;
use crate::trap::Trap;

impl Cpu {
    /// Address of a transfer; the base as it will be if the transfer succeeds.
    #[inline]
    fn address(&self, insn: &Insn) -> (u32, Option<u32>) {
        let base = self.reg(insn.n);
        match insn.index {
            Index::Offset => (base.wrapping_add(insn.imm), None),
            Index::Register => (base.wrapping_add(self.reg(insn.m) << insn.amount), None),
            Index::Literal => (insn.imm, None),
            Index::Pre => {
                let address = base.wrapping_add(insn.imm);
                (address, Some(address))
            }
            Index::Post => (base, Some(base.wrapping_add(insn.imm))),
        }
    }

    /// Whether a core refuses an access; `aligned` where the instruction needs an aligned address on every core.
    #[inline]
    fn refuses(&self, address: u32, bytes: u32, aligned: bool) -> bool {
        address & (bytes - 1) != 0 && (aligned || self.arch == Arch::V6M)
    }

    /// Reads `N` bytes; `aligned` where the instruction needs an aligned address on every core.
    #[inline]
    pub(crate) fn load<const N: usize>(
        &self,
        bus: &mut Bus,
        address: u32,
        aligned: bool,
    ) -> Result<u32, Trap> {
        if self.refuses(address, N as u32, aligned) {
            return Err(Trap::access(address, false, AccessError::Unaligned));
        }
        bus.read::<N>(address, || self.masks()).map_err(|error| Trap::access(address, false, error))
    }

    /// Writes `N` bytes.
    #[inline]
    pub(crate) fn store<const N: usize>(
        &self,
        bus: &mut Bus,
        address: u32,
        value: u32,
        aligned: bool,
    ) -> Result<(), Trap> {
        if self.refuses(address, N as u32, aligned) {
            return Err(Trap::access(address, true, AccessError::Unaligned));
        }
        bus.write::<N>(address, value).map_err(|error| Trap::access(address, true, error))
    }

    #[inline]
    pub(crate) fn transfer_or_branch(
        &mut self,
        insn: &Insn,
        bus: &mut Bus,
        outcome: &mut Outcome,
    ) -> Result<(), Trap> {
        match insn.op {
            Op::Ldr | Op::Ldrb | Op::Ldrh | Op::Ldrsb | Op::Ldrsh | Op::LdrPc => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let value = match insn.op {
                    Op::Ldr | Op::LdrPc => self.load::<4>(bus, address, false)?,
                    Op::Ldrb => self.load::<1>(bus, address, false)?,
                    Op::Ldrh => self.load::<2>(bus, address, false)?,
                    Op::Ldrsb => i32::from(self.load::<1>(bus, address, false)? as i8) as u32,
                    _ => i32::from(self.load::<2>(bus, address, false)? as i16) as u32,
                };
                if let Some(base) = base {
                    self.set_reg(insn.n, base);
                }
                if insn.op == Op::LdrPc {
                    return Self::interwork(value, outcome);
                }
                self.set_reg(insn.d, value);
            }
            Op::Str | Op::Strb | Op::Strh => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let value = self.reg(insn.d);
                match insn.op {
                    Op::Str => self.store::<4>(bus, address, value, false)?,
                    Op::Strb => self.store::<1>(bus, address, value, false)?,
                    _ => self.store::<2>(bus, address, value, false)?,
                }
                if let Some(base) = base {
                    self.set_reg(insn.n, base);
                }
            }
            Op::Ldrd => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let first = self.load::<4>(bus, address, true)?;
                let second = self.load::<4>(bus, address.wrapping_add(4), true)?;
                if let Some(base) = base {
                    self.set_reg(insn.n, base);
                }
                self.set_reg(insn.d, first);
                self.set_reg(insn.a, second);
            }
            Op::Strd => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                self.store::<4>(bus, address, self.reg(insn.d), true)?;
                self.store::<4>(bus, address.wrapping_add(4), self.reg(insn.a), true)?;
                if let Some(base) = base {
                    self.set_reg(insn.n, base);
                }
            }
            Op::Ldm => return self.load_multiple(insn, bus, outcome),
            Op::Stm => return self.store_multiple(insn, bus, outcome),
            Op::B => outcome.jump(insn.imm),
            Op::Cbz | Op::Cbnz => {
                if (self.reg(insn.n) == 0) == (insn.op == Op::Cbz) {
                    outcome.jump(insn.imm);
                }
            }
            Op::Bl => {
                self.r[14] = outcome.next | 1;
                outcome.jump(insn.imm);
            }
            Op::Bx => return Self::interwork(self.reg(insn.m), outcome),
            Op::BlxReg => {
                let target = self.reg(insn.m);
                self.r[14] = outcome.next | 1;
                return Self::interwork(target, outcome);
            }
            Op::MovPc => outcome.jump(self.reg(insn.m) & !1),
            Op::AddPc => {
                let target = self.r[15].wrapping_add(self.reg(insn.m));
                outcome.jump(target & !1);
            }
            Op::Tbb | Op::Tbh => {
                let (base, index) = (self.reg(insn.n), self.reg(insn.m));
                let half = insn.op == Op::Tbh;
                let address = base.wrapping_add(if half { index << 1 } else { index });
                outcome.address = address;
                let offset = if half {
                    self.load::<2>(bus, address, false)?
                } else {
                    self.load::<1>(bus, address, false)?
                };
                let target = self.r[15].wrapping_add(offset << 1);
                outcome.jump(target);
            }
            Op::Nop | Op::It | Op::Barrier => {}
            _ => return self.system(insn, bus, outcome),
        }
        Ok(())
    }

    /// A branch whose target says which instruction set is there.
    #[inline]
    fn interwork(target: u32, outcome: &mut Outcome) -> Result<(), Trap> {
        if target & 1 == 0 {
            return Err(Trap::Fault(Cause::ArmState { target }));
        }
        outcome.jump(target & !1);
        Ok(())
    }

    fn load_multiple(&mut self, insn: &Insn, bus: &mut Bus, outcome: &mut Outcome) -> Result<(), Trap> {
        let base = self.reg(insn.n);
        let size = insn.imm.count_ones() * 4;
        let mut address = if insn.amount == 1 { base.wrapping_sub(size) } else { base };
        let end = if insn.amount == 1 { address } else { base.wrapping_add(size) };
        outcome.address = address;
        let mut target = None;
        let mut list = insn.imm;
        // A register that is loaded last wins over the write back of the base.
        if insn.s {
            self.set_reg(insn.n, end);
        }
        while list != 0 {
            let register = list.trailing_zeros();
            list &= list - 1;
            let value = self.load::<4>(bus, address, true).inspect_err(|_| {
                self.r[usize::from(insn.n & 15)] = base;
            })?;
            if register == 15 {
                target = Some(value);
            } else {
                self.set_reg(register as u8, value);
            }
            address = address.wrapping_add(4);
        }
        match target {
            Some(target) => Self::interwork(target, outcome),
            None => Ok(()),
        }
    }

    fn store_multiple(&mut self, insn: &Insn, bus: &mut Bus, outcome: &mut Outcome) -> Result<(), Trap> {
        let base = self.reg(insn.n);
        let size = insn.imm.count_ones() * 4;
        let mut address = if insn.amount == 1 { base.wrapping_sub(size) } else { base };
        let end = if insn.amount == 1 { address } else { base.wrapping_add(size) };
        outcome.address = address;
        let mut list = insn.imm;
        while list != 0 {
            let register = list.trailing_zeros();
            list &= list - 1;
            self.store::<4>(bus, address, self.reg(register as u8), true)?;
            address = address.wrapping_add(4);
        }
        if insn.s {
            self.set_reg(insn.n, end);
        }
        Ok(())
    }
}
