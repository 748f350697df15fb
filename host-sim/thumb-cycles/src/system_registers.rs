//! The core's own registers from 0xE000_0000 on (DDI 0403, B3 and C1): ITM, DWT, SysTick, NVIC, system control.

use crate::cores::Core;
use crate::cycle_counter::CycleCounter;
use crate::insn::Arch;
use crate::nvic::{Masks, NMI, Nvic, PEND_SV, SYS_TICK};
use crate::peripheral::Peripheral;
use crate::systick::SysTick;

const ITM: u32 = 0xe000_0000;
const DWT: u32 = 0xe000_1000;
const SYSTEM: u32 = 0xe000_e000;

/// AIRCR: a write counts with this key in its top half only; SYSRESETREQ.
const AIRCR_KEY: u32 = 0x05fa;
const RESET_REQUEST: u32 = 1 << 2;

/// Their state.
#[derive(Clone, Debug)]
pub(crate) struct SystemRegisters {
    /// The interrupt controller.
    pub nvic: Nvic,
    /// VTOR: where the vectors are.
    pub vector_table: u32,
    /// A number that was written to an ITM stimulus port, and the port, until the machine takes it.
    pub itm_write: Option<(u8, u32)>,
    /// The image has asked for a reset.
    pub reset_requested: bool,
    systick: SysTick,
    cycle_counter: CycleCounter,
    /// SCR and DEMCR as written.
    system_control: u32,
    debug_control: u32,
    core: Core,
}

impl SystemRegisters {
    /// As after reset.
    pub fn new(core: Core, priority_bits: u8, vector_table: u32) -> Self {
        Self {
            nvic: Nvic::new(priority_bits),
            vector_table,
            itm_write: None,
            reset_requested: false,
            systick: SysTick::default(),
            cycle_counter: CycleCounter::default(),
            system_control: 0,
            debug_control: 0,
            core,
        }
    }

    /// The word at `address`, a multiple of 4; `None` where no such register can be.
    pub fn read(&mut self, address: u32, masks: Masks, now: u64) -> Option<u32> {
        let offset = address & 0xfff;
        let value = match address & !0xfff {
            // Stimulus ports are always ready.
            ITM => 1,
            DWT => self.cycle_counter.read(offset, now),
            SYSTEM => match offset {
                0x010..=0x01f => self.systick.read(offset - 0x10, now),
                0xd00 => self.cpuid(),
                0xd04 => self.interrupt_control_state(masks),
                0xd08 => self.vector_table,
                0xd10 => self.system_control,
                // CCR: STKALIGN; unaligned accesses trap on ARMv6-M only.
                0xd14 => 0x200 | if self.core.arch() == Arch::V6M { 8 } else { 0 },
                0xdfc => self.debug_control,
                // Registers that are not there read as zero.
                _ => self.nvic.read(offset).unwrap_or(0),
            },
            _ => return None,
        };
        Some(value)
    }

    /// Writes `bytes` bytes at `address`; `false` where no such register can be.
    pub fn write(&mut self, address: u32, value: u32, bytes: u32, now: u64) -> bool {
        let offset = address & 0xfff;
        match address & !0xfff {
            ITM if offset < 0x80 => self.itm_write = Some(((offset / 4) as u8, value)),
            ITM => {}
            DWT => self.cycle_counter.write(offset, value, now),
            SYSTEM => match offset {
                0x010..=0x01f => self.systick.write(offset - 0x10, value, bytes, now),
                0xd04 => self.set_interrupt_control_state(value),
                0xd08 => self.vector_table = value & !0x7f,
                0xd0c if value >> 16 == AIRCR_KEY && value & RESET_REQUEST != 0 => {
                    self.reset_requested = true;
                }
                0xd10 => self.system_control = value & 0x1e,
                0xdfc => self.debug_control = value,
                // Registers that are not there ignore writes.
                _ => {
                    self.nvic.write(offset, value, bytes);
                }
            },
            _ => return false,
        }
        true
    }

    /// Brings SysTick to the cycle `now`, and asks for its exception if that is due.
    pub fn advance(&mut self, now: u64) {
        if self.systick.advance(now).interrupts != 0 {
            self.nvic.pending.set(SYS_TICK, true);
        }
    }

    /// The next cycle at which SysTick asks for its exception.
    pub fn next_event(&self, now: u64) -> Option<u64> {
        self.systick.next_event(now)
    }

    /// SCR.SEVONPEND: whatever becomes pending is an event.
    pub fn pending_is_event(&self) -> bool {
        const SEVONPEND: u32 = 1 << 4;
        self.system_control & SEVONPEND != 0
    }

    /// CPUID of a common revision of the core.
    fn cpuid(&self) -> u32 {
        match self.core {
            Core::M0 => 0x410c_c200,
            Core::M0Plus | Core::M0PlusSlow => 0x410c_c601,
            Core::M3 => 0x412f_c231,
            Core::M4 | Core::Untimed => 0x410f_c241,
            Core::M33 => 0x410f_d213,
            Core::M7 => 0x411f_c272,
        }
    }

    /// ICSR.
    fn interrupt_control_state(&self, masks: Masks) -> u32 {
        let pending = &self.nvic.pending;
        let next = self.nvic.next_exception(masks).unwrap_or(0);
        u32::from(pending.has(NMI)) << 31
            | u32::from(pending.has(PEND_SV)) << 28
            | u32::from(pending.has(SYS_TICK)) << 26
            | u32::from(next) << 12
            | u32::from(masks.ipsr)
    }

    fn set_interrupt_control_state(&mut self, value: u32) {
        let pending = &mut self.nvic.pending;
        for (number, set, clear) in [(NMI, 31, None), (PEND_SV, 28, Some(27)), (SYS_TICK, 26, Some(25))] {
            if value & 1 << set != 0 {
                pending.set(number, true);
            } else if clear.is_some_and(|bit: u32| value & 1 << bit != 0) {
                pending.set(number, false);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pending_can_be_seen_and_taken_back() {
        let mut system = SystemRegisters::new(Core::M4, 3, 0);
        assert!(system.write(0xe000_ed04, 1 << 28, 4, 0));
        let state = system.read(0xe000_ed04, Masks::default(), 0).unwrap();
        assert_eq!(state, 1 << 28 | 14 << 12);
        let masked = Masks { primask: true, ..Masks::default() };
        assert_eq!(system.read(0xe000_ed04, masked, 0), Some(1 << 28));
        assert!(system.write(0xe000_ed04, 1 << 27, 4, 0));
        assert_eq!(system.read(0xe000_ed04, Masks::default(), 0), Some(0));
    }

    #[test]
    fn a_reset_needs_its_key() {
        let mut system = SystemRegisters::new(Core::M4, 3, 0);
        assert!(system.write(0xe000_ed0c, 4, 4, 0));
        assert!(!system.reset_requested);
        assert!(system.write(0xe000_ed0c, 0x05fa_0004, 4, 0));
        assert!(system.reset_requested);
    }

    #[test]
    fn other_addresses_are_somebody_elses() {
        let mut system = SystemRegisters::new(Core::M4, 3, 0);
        assert_eq!(system.read(0xe000_2000, Masks::default(), 0), None);
        assert!(!system.write(0xe000_2000, 0, 4, 0));
    }
}
