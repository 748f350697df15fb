//! The programmer's registers.

use crate::insn::Arch;
use crate::nvic::Masks;

/// The condition flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    /// Negative.
    pub n: bool,
    /// Zero.
    pub z: bool,
    /// Carry.
    pub c: bool,
    /// Overflow.
    pub v: bool,
    /// Sticky saturation.
    pub q: bool,
    /// Greater or equal, a bit for each byte.
    pub ge: u8,
}

impl Flags {
    /// Whether condition `cond`, 0 to 14, holds (Arm DDI 0403, A7.3).
    #[inline]
    pub fn pass(self, cond: u8) -> bool {
        let held = match cond >> 1 {
            0 => self.z,
            1 => self.c,
            2 => self.n,
            3 => self.v,
            4 => self.c && !self.z,
            5 => self.n == self.v,
            6 => self.n == self.v && !self.z,
            _ => return true,
        };
        held == (cond & 1 == 0)
    }

    /// As in the APSR.
    pub fn to_bits(self) -> u32 {
        u32::from(self.n) << 31
            | u32::from(self.z) << 30
            | u32::from(self.c) << 29
            | u32::from(self.v) << 28
            | u32::from(self.q) << 27
            | u32::from(self.ge) << 16
    }

    /// From the APSR.
    pub fn from_bits(word: u32) -> Self {
        let bit = |at: u32| word & 1 << at != 0;
        Self { n: bit(31), z: bit(30), c: bit(29), v: bit(28), q: bit(27), ge: (word >> 16) as u8 & 15 }
    }
}

/// The core's registers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cpu {
    /// Which instructions it has.
    pub arch: Arch,
    /// r0 to r12, the stack pointer in use, lr, and what an instruction reads as pc.
    pub r: [u32; 16],
    /// Address of the next instruction.
    pub pc: u32,
    /// Condition flags.
    pub flags: Flags,
    /// Exception number that is being handled; 0 in thread mode.
    pub ipsr: u16,
    /// The stack pointer that is not in use: the process's, or the main one while `control` bit 1 chooses.
    pub other_sp: u32,
    /// nPRIV and SPSEL.
    pub control: u32,
    /// PRIMASK: only faults interrupt.
    pub primask: bool,
    /// FAULTMASK.
    pub faultmask: bool,
    /// BASEPRI: 0, or the lowest priority that does not interrupt.
    pub basepri: u8,
    /// MSPLIM and PSPLIM (ARMv8-M), which are only kept.
    pub limits: [u32; 2],
    /// Exclusive monitor: the address that was marked.
    pub exclusive: Option<u32>,
    /// Event register: the next WFE does not sleep.
    pub event: bool,
}

impl Cpu {
    /// All registers 0.
    pub fn new(arch: Arch) -> Self {
        Self {
            arch,
            r: [0; 16],
            pc: 0,
            flags: Flags::default(),
            ipsr: 0,
            other_sp: 0,
            control: 0,
            primask: false,
            faultmask: false,
            basepri: 0,
            limits: [0; 2],
            exclusive: None,
            event: false,
        }
    }

    /// Register `number`, of which the low four bits count.
    #[inline]
    pub(crate) fn reg(&self, number: u8) -> u32 {
        self.r[usize::from(number & 15)]
    }

    #[inline]
    pub(crate) fn set_reg(&mut self, number: u8, value: u32) {
        self.r[usize::from(number & 15)] = value;
    }

    /// Sets N and Z as a result does.
    #[inline]
    pub(crate) fn set_nz(&mut self, value: u32) {
        self.flags.n = value >> 31 != 0;
        self.flags.z = value == 0;
    }

    /// What the interrupt controller sees of it.
    pub(crate) fn masks(&self) -> Masks {
        Masks { ipsr: self.ipsr, primask: self.primask, faultmask: self.faultmask, basepri: self.basepri }
    }

    /// Whether the process stack is in use.
    pub fn on_process_stack(&self) -> bool {
        self.ipsr == 0 && self.control & 2 != 0
    }

    /// The xPSR without IT bits.
    pub fn xpsr(&self) -> u32 {
        self.flags.to_bits() | u32::from(self.ipsr) | 1 << 24
    }
}
