//! Instructions on the core's state: exclusives, special registers, hints and traps (DDI 0403, A7.7 and B5.2).

use crate::bus::Bus;
use crate::cpu::{Cpu, Flags};
use crate::insn::{Arch, Insn, Op};
use crate::outcome::Outcome;
use crate::trap::Trap;

impl Cpu {
    pub(crate) fn system(&mut self, insn: &Insn, bus: &mut Bus, outcome: &mut Outcome) -> Result<(), Trap> {
        match insn.op {
            Op::LoadAcquire => {
                let address = self.reg(insn.n).wrapping_add(insn.imm);
                outcome.address = address;
                let value = match insn.amount {
                    1 => self.load::<1>(bus, address, true)?,
                    2 => self.load::<2>(bus, address, true)?,
                    _ => self.load::<4>(bus, address, true)?,
                };
                if insn.s {
                    self.exclusive = Some(address);
                }
                self.set_reg(insn.d, value);
            }
            Op::StoreRelease => {
                let address = self.reg(insn.n).wrapping_add(insn.imm);
                outcome.address = address;
                if insn.s && self.exclusive.take() != Some(address) {
                    self.set_reg(insn.d, 1);
                    return Ok(());
                }
                let value = self.reg(insn.a);
                match insn.amount {
                    1 => self.store::<1>(bus, address, value, true)?,
                    2 => self.store::<2>(bus, address, value, true)?,
                    _ => self.store::<4>(bus, address, value, true)?,
                }
                if insn.s {
                    self.set_reg(insn.d, 0);
                }
            }
            Op::Clrex => self.exclusive = None,
            Op::Cps => {
                let disable = insn.imm & 0x10 != 0;
                if self.ipsr != 0 || self.control & 1 == 0 {
                    if insn.imm & 2 != 0 {
                        self.primask = disable;
                    }
                    if insn.imm & 1 != 0 {
                        self.faultmask = disable;
                    }
                }
                bus.clock.expire();
            }
            Op::Mrs => {
                let value = self.special_register(insn.imm);
                self.set_reg(insn.d, value);
            }
            Op::Msr => {
                self.set_special_register(insn.imm, u32::from(insn.amount), self.reg(insn.n));
                // What was held back may interrupt now.
                bus.clock.expire();
            }
            Op::Tt => self.set_reg(insn.d, 0),
            Op::Sev => self.event = true,
            Op::Wfi => return Err(Trap::Sleep { event: false }),
            Op::Wfe => return Err(Trap::Sleep { event: true }),
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
        let cpu = self;
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
        let cpu = self;
        let (v6m, has_dsp) = (cpu.arch == Arch::V6M, cpu.arch >= Arch::V7EM);
        let process = cpu.on_process_stack();
        match number {
            0..=3 => {
                let new = Flags::from_bits(value);
                if mask & 2 != 0 || v6m {
                    cpu.flags = Flags { q: cpu.flags.q, ge: cpu.flags.ge, ..new };
                    if !v6m {
                        cpu.flags.q = new.q;
                    }
                }
                if mask & 1 != 0 && has_dsp {
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
    }
}
