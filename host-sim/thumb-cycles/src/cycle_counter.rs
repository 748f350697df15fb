//! CYCCNT of the data watchpoint and trace unit (DDI 0403, C1.8).

/// The counter, computed from the cycle count when it is looked at.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CycleCounter {
    enabled: bool,
    /// While it is enabled: the cycle at which it was 0. Otherwise its value.
    base: u32,
}

impl CycleCounter {
    fn count(&self, now: u64) -> u32 {
        if self.enabled { (now as u32).wrapping_sub(self.base) } else { self.base }
    }

    fn set_count(&mut self, count: u32, now: u64) {
        self.base = if self.enabled { (now as u32).wrapping_sub(count) } else { count };
    }

    /// Reads the register at `offset` from 0xE000_1000.
    pub fn read(&self, offset: u32, now: u64) -> u32 {
        match offset {
            // DWT_CTRL: four comparators and CYCCNT; nothing but CYCCNT does anything.
            0 => 0x4000_0000 | u32::from(self.enabled),
            4 => self.count(now),
            _ => 0,
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) {
        match offset {
            0 => {
                let count = self.count(now);
                self.enabled = value & 1 != 0;
                self.set_count(count, now);
            }
            4 => self.set_count(value, now),
            _ => {}
        }
    }
}
