//! The system timer (DDI 0403, B3.3), computed from the cycle count when it is looked at.

use crate::peripheral::{Peripheral, Signals};

/// The timer's state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SysTick {
    control: u32,
    reload: u32,
    /// While it runs: a cycle at which it was 0, or would have been. Otherwise its value is in `stopped`.
    zero_at: i64,
    stopped: u32,
    /// Wraps that were seen: COUNTFLAG is set while there are more.
    seen: u64,
    /// Wraps whose interrupt was asked for.
    asked: u64,
}

impl SysTick {
    const ENABLE: u32 = 1;
    const INTERRUPT: u32 = 2;

    fn runs(&self) -> bool {
        self.control & Self::ENABLE != 0 && self.reload != 0
    }

    fn period(&self) -> u64 {
        u64::from(self.reload) + 1
    }

    /// Cycles since it was 0 at `zero_at`.
    fn elapsed(&self, now: u64) -> u64 {
        (now as i64 - self.zero_at) as u64
    }

    /// How often it has reached 0 since it was last set.
    fn wraps(&self, now: u64) -> u64 {
        if self.runs() { self.elapsed(now) / self.period() } else { 0 }
    }

    fn value(&self, now: u64) -> u32 {
        if !self.runs() {
            return self.stopped;
        }
        match self.elapsed(now) % self.period() {
            0 => 0,
            elapsed => (self.period() - elapsed) as u32,
        }
    }

    /// Continues from `value` with what the registers say now.
    fn restart(&mut self, now: u64, value: u32) {
        self.stopped = value;
        self.zero_at = now as i64;
        if value > 0 {
            self.zero_at -= self.period() as i64 - i64::from(value);
        }
        self.seen = self.wraps(now);
        self.asked = self.seen;
    }

    /// Whether an interrupt is due that was not asked for yet; it counts as asked for.
    fn take_due(&mut self, now: u64) -> bool {
        let wraps = self.wraps(now);
        let due = wraps > self.asked && self.control & Self::INTERRUPT != 0;
        self.asked = wraps;
        due
    }
}

/// Offsets are from 0xE000_E010. Its one line is that of the SysTick exception.
impl Peripheral for SysTick {
    fn read(&mut self, offset: u32, now: u64) -> u32 {
        match offset {
            0 => {
                let wraps = self.wraps(now);
                let flag = u32::from(wraps > self.seen) << 16;
                self.seen = wraps;
                self.control | flag
            }
            4 => self.reload,
            8 => self.value(now),
            // CALIB: no reference clock.
            _ => 0x8000_0000,
        }
    }

    fn write(&mut self, offset: u32, word: u32, _: u32, now: u64) {
        let value = self.value(now);
        match offset {
            0 => {
                let started = self.runs();
                self.control = word & 7;
                if started != self.runs() {
                    self.restart(now, value);
                }
            }
            4 => {
                self.reload = word & 0x00ff_ffff;
                self.restart(now, value.min(self.reload));
            }
            8 => self.restart(now, 0),
            _ => {}
        }
    }

    fn advance(&mut self, now: u64) -> Signals {
        Signals { interrupts: u32::from(self.take_due(now)), sent: None }
    }

    fn next_event(&self, now: u64) -> Option<u64> {
        if !self.runs() || self.control & Self::INTERRUPT == 0 {
            return None;
        }
        Some(now + self.period() - self.elapsed(now) % self.period())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_counts_down_from_the_reload_value_and_asks_once_a_period() {
        let mut timer = SysTick::default();
        timer.write(4, 99, 4, 1000);
        timer.write(8, 0, 4, 1000);
        timer.write(0, 7, 4, 1000);
        assert_eq!(timer.read(8, 1000), 0);
        assert_eq!(timer.read(8, 1001), 99);
        assert_eq!(timer.read(8, 1099), 1);
        assert_eq!(timer.next_event(1050), Some(1100));
        assert!(!timer.take_due(1099));
        assert!(timer.take_due(1100));
        assert!(!timer.take_due(1150));
        assert_eq!(timer.read(0, 1150), 7 | 1 << 16);
        assert_eq!(timer.read(0, 1151), 7);
        assert_eq!(timer.next_event(1150), Some(1200));
    }

    #[test]
    fn it_goes_on_from_where_it_was_stopped() {
        let mut timer = SysTick::default();
        timer.write(4, 999, 4, 0);
        timer.write(8, 0, 4, 0);
        timer.write(0, 5, 4, 0);
        timer.write(0, 4, 4, 300);
        assert_eq!(timer.read(8, 5000), 700);
        timer.write(0, 7, 4, 6000);
        assert_eq!(timer.read(8, 6100), 600);
        assert_eq!(timer.next_event(6100), Some(6700));
    }
}
