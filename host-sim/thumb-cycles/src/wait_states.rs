//! Memory with wait states, as the core sees it: one line is kept, and the next line may be read ahead.
//!
//! This is the least that real flash interfaces have (the STM32F1's prefetch buffer is two lines of 64 bits); caches
//! such as the STM32F4's ART do better.

/// How long reads of a region take. Zero wait states unless said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WaitStates {
    /// Cycles that a read takes beyond one.
    pub cycles: u32,
    /// Bytes that one read brings (4 to 32, a power of two); code in the same line costs no more reads.
    pub line: u32,
    /// Whether the next line is read ahead while this one executes.
    pub prefetch: bool,
    /// Whether code comes from a cache that always hits; data does not.
    pub cached_code: bool,
}

impl WaitStates {
    /// No wait states.
    pub const NONE: Self = Self { cycles: 0, line: 4, prefetch: false, cached_code: false };
}

/// The line that is kept.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LineBuffer {
    /// Its first address, with 1 added so that 0 is none.
    line: u64,
    /// The cycle at which the line after it has been read ahead.
    ahead: u64,
}

impl LineBuffer {
    /// Cycles that the core waits for the code at `pc`.
    pub fn fetch(&mut self, waits: WaitStates, pc: u32, bytes: u32, now: u64) -> u32 {
        if waits.cycles == 0 || waits.cached_code {
            return 0;
        }
        let mut stall = 0;
        let (first, last) = (pc / waits.line, pc.wrapping_add(bytes.max(2) - 1) / waits.line);
        for number in first..=last.max(first) {
            stall += self.read_line(waits, number, now + u64::from(stall));
        }
        stall
    }

    fn read_line(&mut self, waits: WaitStates, number: u32, now: u64) -> u32 {
        let line = u64::from(number) + 1;
        if line == self.line {
            return 0;
        }
        let stall = if waits.prefetch && line == self.line + 1 {
            self.ahead.saturating_sub(now) as u32
        } else {
            waits.cycles
        };
        self.line = line;
        self.ahead = now + u64::from(stall + waits.cycles) + 1;
        stall
    }

    /// Cycles that the core waits for `bytes` of data. Reading data holds the reading ahead up.
    pub fn read(&mut self, waits: WaitStates, address: u32, bytes: u32, now: u64) -> u32 {
        if waits.cycles == 0 {
            return 0;
        }
        let lines = address.wrapping_add(bytes.max(1) - 1) / waits.line - address / waits.line + 1;
        let stall = lines * waits.cycles;
        self.ahead = self.ahead.max(now) + u64::from(stall) + 1;
        stall
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_waited_for_once() {
        let waits = WaitStates { cycles: 2, line: 8, prefetch: false, cached_code: false };
        let mut buffer = LineBuffer::default();
        assert_eq!(buffer.fetch(waits, 0x100, 2, 0), 2);
        assert_eq!(buffer.fetch(waits, 0x104, 4, 3), 0);
        // Across two lines of which one is there.
        assert_eq!(buffer.fetch(waits, 0x106, 4, 5), 2);
        assert_eq!(buffer.read(waits, 0x200, 4, 9), 2);
    }

    #[test]
    fn reading_ahead_hides_the_wait_of_straight_code() {
        let waits = WaitStates { cycles: 2, line: 8, prefetch: true, cached_code: false };
        let mut buffer = LineBuffer::default();
        assert_eq!(buffer.fetch(waits, 0x100, 2, 0), 2);
        // Four 16-bit instructions take four cycles; the next line took three.
        assert_eq!(buffer.fetch(waits, 0x108, 2, 6), 0);
        // Two 32-bit instructions take two.
        assert_eq!(buffer.fetch(waits, 0x110, 4, 8), 1);
    }
}
