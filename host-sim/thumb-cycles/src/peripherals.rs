//! Registers that are no memory: the core's own at 0xE000_0000 (DDI 0403, B3), and the UART's.

use crate::board::Core;
use crate::machine::{Machine, Trap};
use crate::memory::AccessError;
use crate::nvic::{PEND_SV, SYS_TICK};

const ITM: u32 = 0xe000_0000;
const DWT: u32 = 0xe000_1000;
const SYSTEM: u32 = 0xe000_e000;

impl Machine {
    pub(crate) fn read_peripheral(&mut self, address: u32, bytes: u32) -> Result<u32, Trap> {
        let word = self.read_register(address & !3).ok_or(Trap::Access {
            address,
            write: false,
            error: AccessError::Unmapped,
        })?;
        let shifted = word >> ((address & 3) * 8);
        Ok(if bytes == 4 { shifted } else { shifted & ((1 << (bytes * 8)) - 1) })
    }

    fn read_register(&mut self, address: u32) -> Option<u32> {
        let now = self.cycles;
        if let Some(uart) = &mut self.uart
            && address & !0xfff == uart.base
        {
            return Some(uart.read(address & 0xfff));
        }
        match address & !0xfff {
            // Stimulus ports are always ready.
            ITM => Some(1),
            DWT => Some(match address & 0xfff {
                0 => 0x4000_0000 | self.dwt_control,
                4 => self.cyccnt(),
                _ => 0,
            }),
            SYSTEM => {
                let offset = address & 0xfff;
                let value = match offset {
                    0x010..=0x01f => self.systick.read(offset - 0x10, now),
                    0xd00 => self.cpuid(),
                    0xd04 => self.icsr(),
                    0xd08 => self.vtor,
                    0xd10 => self.scr,
                    // STKALIGN; unaligned accesses trap on ARMv6-M only.
                    0xd14 => 0x200 | if self.aligned_only { 8 } else { 0 },
                    0xdfc => self.demcr,
                    _ => self.nvic.read(offset).unwrap_or(0),
                };
                Some(value)
            }
            _ => None,
        }
    }

    pub(crate) fn write_peripheral(&mut self, address: u32, value: u32, bytes: u32) -> Result<(), Trap> {
        let now = self.cycles;
        let trap = Trap::Access { address, write: true, error: AccessError::Unmapped };
        if let Some(uart) = &mut self.uart
            && address & !0xfff == uart.base
        {
            uart.write(address & 0xffc, value, now);
            self.look();
            return Ok(());
        }
        let offset = address & 0xfff;
        match address & !0xfff {
            ITM => {
                if offset < 0x80 {
                    self.mark = Some(((offset / 4) as u8, value));
                }
            }
            DWT => match offset {
                0 => {
                    let count = self.cyccnt();
                    self.dwt_control = value & 1;
                    self.set_cyccnt(count);
                }
                4 => self.set_cyccnt(value),
                _ => {}
            },
            SYSTEM => match offset {
                0x010..=0x01f => self.systick.write(offset - 0x10, value, now),
                0xd04 => self.set_icsr(value),
                0xd08 => self.vtor = value & !0x7f,
                0xd0c if value >> 16 == 0x05fa && value & 4 != 0 => self.reset = true,
                0xd10 => self.scr = value & 0x1e,
                0xdfc => self.demcr = value,
                _ => {
                    // Registers that are not there read as zero and ignore writes.
                    let _known = self.nvic.write(offset, value, bytes);
                }
            },
            _ => return Err(trap),
        }
        self.look();
        Ok(())
    }

    /// CYCCNT: the cycles since it was set, while it is enabled.
    fn cyccnt(&self) -> u32 {
        if self.dwt_control & 1 == 0 {
            return self.cyccnt_base;
        }
        (self.cycles as u32).wrapping_sub(self.cyccnt_base)
    }

    fn set_cyccnt(&mut self, count: u32) {
        let enabled = self.dwt_control & 1 != 0;
        self.cyccnt_base = if enabled { (self.cycles as u32).wrapping_sub(count) } else { count };
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

    fn icsr(&self) -> u32 {
        let pending = &self.nvic.pending;
        let next = self.pending_exception().unwrap_or(0);
        u32::from(pending.has(2)) << 31
            | u32::from(pending.has(PEND_SV)) << 28
            | u32::from(pending.has(SYS_TICK)) << 26
            | u32::from(next) << 12
            | u32::from(self.cpu.ipsr)
    }

    fn set_icsr(&mut self, value: u32) {
        let pending = &mut self.nvic.pending;
        for (number, set, clear) in [(2, 31, None), (PEND_SV, 28, Some(27)), (SYS_TICK, 26, Some(25))] {
            if value & 1 << set != 0 {
                pending.set(number, true);
            } else if clear.is_some_and(|bit: u32| value & 1 << bit != 0) {
                pending.set(number, false);
            }
        }
    }
}
