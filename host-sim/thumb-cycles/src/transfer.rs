//! Loads, stores, branches, and the core's state.

use crate::insn::{Index, Insn, Op};
use crate::machine::{Machine, Outcome, Trap};
use crate::memory::AccessError;

impl Machine {
    #[inline]
    fn read_reg(&self, register: u8) -> u32 {
        self.cpu.r[usize::from(register & 15)]
    }

    #[inline]
    fn write_reg(&mut self, register: u8, value: u32) {
        self.cpu.r[usize::from(register & 15)] = value;
    }

    /// Address of a transfer; the base as it will be if the transfer succeeds.
    #[inline]
    fn address(&self, insn: &Insn) -> (u32, Option<u32>) {
        let base = self.read_reg(insn.n);
        match insn.index {
            Index::Offset => (base.wrapping_add(insn.imm), None),
            Index::Register => (base.wrapping_add(self.read_reg(insn.m) << insn.amount), None),
            Index::Literal => (insn.imm, None),
            Index::Pre => {
                let address = base.wrapping_add(insn.imm);
                (address, Some(address))
            }
            Index::Post => (base, Some(base.wrapping_add(insn.imm))),
        }
    }

    /// Reads `N` bytes; `aligned` where the instruction needs an aligned address on every core.
    #[inline]
    pub(crate) fn load<const N: usize>(&mut self, address: u32, aligned: bool) -> Result<u32, Trap> {
        let misaligned = address & (N as u32 - 1) != 0;
        if misaligned && (aligned || self.aligned_only) {
            return Err(Trap::Access { address, write: false, error: AccessError::Unaligned });
        }
        match self.memory.read::<N>(address) {
            Some(bytes) => {
                let mut word = [0; 4];
                for (to, from) in word.iter_mut().zip(bytes) {
                    *to = from;
                }
                Ok(u32::from_le_bytes(word))
            }
            None => self.read_peripheral(address, N as u32),
        }
    }

    /// Writes `N` bytes.
    #[inline]
    pub(crate) fn store<const N: usize>(
        &mut self,
        address: u32,
        value: u32,
        aligned: bool,
    ) -> Result<(), Trap> {
        let misaligned = address & (N as u32 - 1) != 0;
        if misaligned && (aligned || self.aligned_only) {
            return Err(Trap::Access { address, write: true, error: AccessError::Unaligned });
        }
        let word = value.to_le_bytes();
        let mut bytes = [0; N];
        for (to, from) in bytes.iter_mut().zip(word) {
            *to = from;
        }
        match self.memory.write(address, bytes) {
            Ok(()) => Ok(()),
            Err(AccessError::Unmapped) => self.write_peripheral(address, value, N as u32),
            Err(error) => Err(Trap::Access { address, write: true, error }),
        }
    }

    #[inline]
    pub(crate) fn transfer_or_branch(&mut self, insn: &Insn, outcome: &mut Outcome) -> Result<(), Trap> {
        match insn.op {
            Op::Ldr | Op::Ldrb | Op::Ldrh | Op::Ldrsb | Op::Ldrsh | Op::LdrPc => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let value = match insn.op {
                    Op::Ldr | Op::LdrPc => self.load::<4>(address, false)?,
                    Op::Ldrb => self.load::<1>(address, false)?,
                    Op::Ldrh => self.load::<2>(address, false)?,
                    Op::Ldrsb => i32::from(self.load::<1>(address, false)? as i8) as u32,
                    _ => i32::from(self.load::<2>(address, false)? as i16) as u32,
                };
                if let Some(base) = base {
                    self.write_reg(insn.n, base);
                }
                if insn.op == Op::LdrPc {
                    return Self::interwork(value, outcome);
                }
                self.write_reg(insn.d, value);
            }
            Op::Str | Op::Strb | Op::Strh => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let value = self.read_reg(insn.d);
                match insn.op {
                    Op::Str => self.store::<4>(address, value, false)?,
                    Op::Strb => self.store::<1>(address, value, false)?,
                    _ => self.store::<2>(address, value, false)?,
                }
                if let Some(base) = base {
                    self.write_reg(insn.n, base);
                }
            }
            Op::Ldrd => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                let first = self.load::<4>(address, true)?;
                let second = self.load::<4>(address.wrapping_add(4), true)?;
                if let Some(base) = base {
                    self.write_reg(insn.n, base);
                }
                self.write_reg(insn.d, first);
                self.write_reg(insn.a, second);
            }
            Op::Strd => {
                let (address, base) = self.address(insn);
                outcome.address = address;
                self.store::<4>(address, self.read_reg(insn.d), true)?;
                self.store::<4>(address.wrapping_add(4), self.read_reg(insn.a), true)?;
                if let Some(base) = base {
                    self.write_reg(insn.n, base);
                }
            }
            Op::Ldm => return self.load_multiple(insn, outcome),
            Op::Stm => return self.store_multiple(insn, outcome),
            Op::B => Self::jump(insn.imm, outcome),
            Op::Cbz | Op::Cbnz => {
                if (self.read_reg(insn.n) == 0) == (insn.op == Op::Cbz) {
                    Self::jump(insn.imm, outcome);
                }
            }
            Op::Bl => {
                self.cpu.r[14] = outcome.next | 1;
                Self::jump(insn.imm, outcome);
            }
            Op::Bx => return Self::interwork(self.read_reg(insn.m), outcome),
            Op::BlxReg => {
                let target = self.read_reg(insn.m);
                self.cpu.r[14] = outcome.next | 1;
                return Self::interwork(target, outcome);
            }
            Op::MovPc => Self::jump(self.read_reg(insn.m) & !1, outcome),
            Op::AddPc => {
                let target = self.cpu.r[15].wrapping_add(self.read_reg(insn.m));
                Self::jump(target & !1, outcome);
            }
            Op::Tbb | Op::Tbh => {
                let (base, index) = (self.read_reg(insn.n), self.read_reg(insn.m));
                let half = insn.op == Op::Tbh;
                let address = base.wrapping_add(if half { index << 1 } else { index });
                outcome.address = address;
                let offset =
                    if half { self.load::<2>(address, false)? } else { self.load::<1>(address, false)? };
                let target = self.cpu.r[15].wrapping_add(offset << 1);
                Self::jump(target, outcome);
            }
            Op::Nop | Op::It | Op::Barrier => {}
            _ => return self.system(insn, outcome),
        }
        Ok(())
    }

    #[inline]
    fn jump(target: u32, outcome: &mut Outcome) {
        outcome.next = target;
        outcome.taken = true;
    }

    /// A branch whose target says which instruction set is there.
    #[inline]
    fn interwork(target: u32, outcome: &mut Outcome) -> Result<(), Trap> {
        if target & 1 == 0 {
            return Err(Trap::ArmState { target });
        }
        Self::jump(target & !1, outcome);
        Ok(())
    }

    fn load_multiple(&mut self, insn: &Insn, outcome: &mut Outcome) -> Result<(), Trap> {
        let base = self.read_reg(insn.n);
        let size = insn.imm.count_ones() * 4;
        let mut address = if insn.amount == 1 { base.wrapping_sub(size) } else { base };
        let end = if insn.amount == 1 { address } else { base.wrapping_add(size) };
        outcome.address = address;
        let mut target = None;
        let mut list = insn.imm;
        // A register that is loaded last wins over the write back of the base.
        if insn.s {
            self.write_reg(insn.n, end);
        }
        while list != 0 {
            let register = list.trailing_zeros();
            list &= list - 1;
            let value = self.load::<4>(address, true).inspect_err(|_| {
                self.cpu.r[usize::from(insn.n & 15)] = base;
            })?;
            if register == 15 {
                target = Some(value);
            } else {
                self.write_reg(register as u8, value);
            }
            address = address.wrapping_add(4);
        }
        match target {
            Some(target) => Self::interwork(target, outcome),
            None => Ok(()),
        }
    }

    fn store_multiple(&mut self, insn: &Insn, outcome: &mut Outcome) -> Result<(), Trap> {
        let base = self.read_reg(insn.n);
        let size = insn.imm.count_ones() * 4;
        let mut address = if insn.amount == 1 { base.wrapping_sub(size) } else { base };
        let end = if insn.amount == 1 { address } else { base.wrapping_add(size) };
        outcome.address = address;
        let mut list = insn.imm;
        while list != 0 {
            let register = list.trailing_zeros();
            list &= list - 1;
            self.store::<4>(address, self.read_reg(register as u8), true)?;
            address = address.wrapping_add(4);
        }
        if insn.s {
            self.write_reg(insn.n, end);
        }
        Ok(())
    }

    fn system(&mut self, insn: &Insn, outcome: &mut Outcome) -> Result<(), Trap> {
        match insn.op {
            Op::LoadAcquire => {
                let address = self.read_reg(insn.n).wrapping_add(insn.imm);
                outcome.address = address;
                let value = match insn.amount {
                    1 => self.load::<1>(address, true)?,
                    2 => self.load::<2>(address, true)?,
                    _ => self.load::<4>(address, true)?,
                };
                if insn.s {
                    self.cpu.exclusive = Some(address);
                }
                self.write_reg(insn.d, value);
            }
            Op::StoreRelease => {
                let address = self.read_reg(insn.n).wrapping_add(insn.imm);
                outcome.address = address;
                if insn.s && self.cpu.exclusive.take() != Some(address) {
                    self.write_reg(insn.d, 1);
                    return Ok(());
                }
                let value = self.read_reg(insn.a);
                match insn.amount {
                    1 => self.store::<1>(address, value, true)?,
                    2 => self.store::<2>(address, value, true)?,
                    _ => self.store::<4>(address, value, true)?,
                }
                if insn.s {
                    self.write_reg(insn.d, 0);
                }
            }
            Op::Clrex => self.cpu.exclusive = None,
            Op::Cps => {
                let disable = insn.imm & 0x10 != 0;
                if self.cpu.ipsr != 0 || self.cpu.control & 1 == 0 {
                    if insn.imm & 2 != 0 {
                        self.cpu.primask = disable;
                    }
                    if insn.imm & 1 != 0 {
                        self.cpu.faultmask = disable;
                    }
                }
                self.look();
            }
            Op::Mrs => {
                let value = self.special_register(insn.imm);
                self.write_reg(insn.d, value);
            }
            Op::Msr => self.set_special_register(insn.imm, u32::from(insn.amount), self.read_reg(insn.n)),
            Op::Tt => self.write_reg(insn.d, 0),
            Op::Sev => self.event = true,
            Op::Wfi => return Err(Trap::Wait { event: false }),
            Op::Wfe => return Err(Trap::Wait { event: true }),
            Op::Svc => return Err(Trap::Supervisor),
            Op::Bkpt => return Err(Trap::Breakpoint { number: insn.imm as u8 }),
            Op::Undecoded => return Err(Trap::Undecoded),
            Op::HostBreakpoint => return Err(Trap::HostBreakpoint),
            Op::Coprocessor => return Err(Trap::Coprocessor),
            _ => return Err(Trap::Undefined),
        }
        Ok(())
    }

    /// MRS (DDI 0403, B5.2.2).
    fn special_register(&self, number: u32) -> u32 {
        let cpu = &self.cpu;
        let process = cpu.on_process_stack();
        match number {
            // IPSR is visible by bit 0, the flags unless bit 2; EPSR reads as zero.
            0..=7 => {
                let ipsr = if number & 1 != 0 { u32::from(cpu.ipsr) } else { 0 };
                let flags = if number & 4 == 0 { cpu.flags.to_bits() } else { 0 };
                ipsr | flags
            }
            8 => {
                if process {
                    cpu.other_sp
                } else {
                    cpu.r[13]
                }
            }
            9 => {
                if process {
                    cpu.r[13]
                } else {
                    cpu.other_sp
                }
            }
            10 => cpu.limits[0],
            11 => cpu.limits[1],
            16 => u32::from(cpu.primask),
            17 | 18 => u32::from(cpu.basepri),
            19 => u32::from(cpu.faultmask),
            20 => cpu.control,
            _ => 0,
        }
    }

    /// MSR (DDI 0403, B5.2.3).
    fn set_special_register(&mut self, number: u32, mask: u32, value: u32) {
        let cpu = &mut self.cpu;
        let process = cpu.on_process_stack();
        match number {
            0..=3 => {
                let new = crate::cpu::Flags::from_bits(value);
                if mask & 2 != 0 || self.aligned_only {
                    cpu.flags = crate::cpu::Flags { q: cpu.flags.q, ge: cpu.flags.ge, ..new };
                    if !self.aligned_only {
                        cpu.flags.q = new.q;
                    }
                }
                if mask & 1 != 0 && self.has_dsp {
                    cpu.flags.ge = new.ge;
                }
            }
            8 if process => cpu.other_sp = value & !3,
            8 => cpu.r[13] = value & !3,
            9 if process => cpu.r[13] = value & !3,
            9 => cpu.other_sp = value & !3,
            10 => cpu.limits[0] = value & !7,
            11 => cpu.limits[1] = value & !7,
            16 => cpu.primask = value & 1 != 0,
            17 => cpu.basepri = value as u8,
            18 => {
                let new = value as u8;
                if new != 0 && (new < cpu.basepri || cpu.basepri == 0) {
                    cpu.basepri = new;
                }
            }
            19 => cpu.faultmask = value & 1 != 0,
            20 => {
                // The stack is chosen in thread mode only.
                let control = if cpu.ipsr == 0 { value & 3 } else { (cpu.control & 2) | (value & 1) };
                if cpu.ipsr == 0 && (control ^ cpu.control) & 2 != 0 {
                    std::mem::swap(&mut cpu.r[13], &mut cpu.other_sp);
                }
                cpu.control = control;
            }
            _ => {}
        }
        self.look();
    }
}
