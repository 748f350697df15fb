//! The interrupt controller: what is pending, what runs, and which wins (DDI 0403, B1.5 and B3.4).

/// Exceptions that are there: 16 of the core and 240 interrupts.
const EXCEPTIONS: usize = 256;

/// The exception number of an interrupt.
pub(crate) fn interrupt_exception(interrupt: u16) -> u16 {
    16 + interrupt
}

/// Numbers of the core's exceptions: NMI.
pub(crate) const NMI: u16 = 2;
/// HardFault.
pub(crate) const HARD_FAULT: u16 = 3;
/// SVC.
pub(crate) const SV_CALL: u16 = 11;
/// PendSV.
pub(crate) const PEND_SV: u16 = 14;
/// SysTick.
pub(crate) const SYS_TICK: u16 = 15;

/// A set of exception numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ExceptionSet([u32; EXCEPTIONS / 32]);

impl ExceptionSet {
    /// Whether a number is in it.
    pub fn has(&self, number: u16) -> bool {
        self.0.get(usize::from(number / 32)).is_some_and(|word| word & 1 << (number % 32) != 0)
    }

    /// Puts a number in or takes it out.
    pub fn set(&mut self, number: u16, present: bool) {
        if let Some(word) = self.0.get_mut(usize::from(number / 32)) {
            let bit = 1 << (number % 32);
            *word = if present { *word | bit } else { *word & !bit };
        }
    }

    /// The numbers in it, in order.
    pub fn iter(self) -> impl Iterator<Item = u16> {
        (0u16..).zip(self.0).flat_map(|(index, mut word)| {
            std::iter::from_fn(move || {
                let bit = word.trailing_zeros();
                word &= word.wrapping_sub(1);
                (bit < 32).then_some(index * 32 + bit as u16)
            })
        })
    }

    /// Interrupts `32 * index` and the 31 after it, a bit each.
    fn interrupts(&self, index: u32) -> u32 {
        (0..32).filter(|bit| self.has((16 + index * 32 + bit) as u16)).fold(0, |word, bit| word | 1 << bit)
    }

    fn set_interrupts(&mut self, index: u32, word: u32, present: bool) {
        for bit in (0..32).filter(|bit| word & 1 << bit != 0) {
            self.set((16 + index * 32 + bit) as u16, present);
        }
    }
}

/// What the core is doing, and what it holds back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Masks {
    /// IPSR: the exception that is being handled, 0 in thread mode.
    pub ipsr: u16,
    /// PRIMASK: only faults interrupt.
    pub primask: bool,
    /// FAULTMASK: only NMI interrupts.
    pub faultmask: bool,
    /// BASEPRI: 0, or the lowest priority that does not interrupt.
    pub basepri: u8,
}

/// The controller's state.
#[derive(Clone, Debug)]
pub(crate) struct Nvic {
    /// Waiting to be handled.
    pub pending: ExceptionSet,
    /// Being handled, one or several nested.
    pub active: ExceptionSet,
    /// Interrupts that may be handled; the core's exceptions always may.
    pub enabled: ExceptionSet,
    priority: [u8; EXCEPTIONS],
    /// Bits of a priority that are there.
    priority_mask: u8,
    /// AIRCR.PRIGROUP.
    group: u8,
}

impl Nvic {
    /// With `bits` bits of priority.
    pub fn new(bits: u8) -> Self {
        Self {
            pending: ExceptionSet::default(),
            active: ExceptionSet::default(),
            enabled: ExceptionSet::default(),
            priority: [0; EXCEPTIONS],
            priority_mask: (0xff00u16 >> bits) as u8,
            group: 0,
        }
    }

    /// Priority of an exception; smaller is more urgent.
    fn priority(&self, number: u16) -> i16 {
        match number {
            1 => -3,
            NMI => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priority.get(usize::from(number)).copied().unwrap_or(0)),
        }
    }

    /// The part of a priority that decides whether one preempts another.
    fn group_priority(&self, priority: i16) -> i16 {
        if priority < 0 { priority } else { priority & !((2i16 << self.group) - 1) }
    }

    /// Priority of what runs, without PRIMASK and the like; 256 in thread mode.
    fn active_priority(&self) -> i16 {
        self.active.iter().map(|number| self.group_priority(self.priority(number))).min().unwrap_or(256)
    }

    /// The exception that is to be handled next, if any may interrupt what runs.
    pub fn next_exception(&self, masks: Masks) -> Option<u16> {
        let Masks { primask, faultmask, basepri, .. } = masks;
        let mut threshold = self.active_priority();
        if basepri != 0 {
            threshold = threshold.min(self.group_priority(i16::from(basepri)));
        }
        if primask {
            threshold = threshold.min(0);
        }
        if faultmask {
            threshold = threshold.min(-1);
        }
        let ready = |number: &u16| *number < 16 || self.enabled.has(*number);
        let first =
            self.pending.iter().filter(ready).min_by_key(|&number| (self.priority(number), number))?;
        (self.group_priority(self.priority(first)) < threshold).then_some(first)
    }

    /// Whether some exception would wake WFI: PRIMASK does not count.
    pub fn wakes(&self, basepri: u8) -> bool {
        self.next_exception(Masks { basepri, ..Masks::default() }).is_some()
    }

    /// Reads a register at `offset` from 0xE000E000 whose state is here.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let index = (offset & 0x7f) / 4;
        let value = match offset {
            0x100..=0x11f | 0x180..=0x19f => self.enabled.interrupts(index),
            0x200..=0x21f | 0x280..=0x29f => self.pending.interrupts(index),
            0x300..=0x31f => self.active.interrupts(index),
            0x400..=0x4ef => self.priorities(16 + (offset - 0x400)),
            0xd18..=0xd23 => self.priorities(4 + (offset - 0xd18)),
            0xd0c => 0xfa05_0000 | u32::from(self.group) << 8,
            _ => return None,
        };
        Some(value)
    }

    fn priorities(&self, first: u32) -> u32 {
        (0..4).fold(0, |word, lane| {
            let priority = self.priority.get((first + lane) as usize).copied().unwrap_or(0);
            word | u32::from(priority) << (lane * 8)
        })
    }

    /// Writes a register; `false` where its state is not here. `bytes` is 1, 2 or 4.
    pub fn write(&mut self, offset: u32, value: u32, bytes: u32) -> bool {
        let index = (offset & 0x7f) / 4;
        let mut set_priorities = |first: u32| {
            for lane in 0..bytes {
                if let Some(priority) = self.priority.get_mut((first + lane) as usize) {
                    *priority = (value >> (lane * 8)) as u8 & self.priority_mask;
                }
            }
        };
        match offset {
            0x100..=0x11f => self.enabled.set_interrupts(index, value, true),
            0x180..=0x19f => self.enabled.set_interrupts(index, value, false),
            0x200..=0x21f => self.pending.set_interrupts(index, value, true),
            0x280..=0x29f => self.pending.set_interrupts(index, value, false),
            0x400..=0x4ef => set_priorities(16 + (offset - 0x400)),
            0xd18..=0xd23 => set_priorities(4 + (offset - 0xd18)),
            0xd0c => {
                if value >> 16 == 0x05fa {
                    self.group = (value >> 8) as u8 & 7;
                }
            }
            _ => return false,
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn next(nvic: &Nvic, primask: bool, faultmask: bool, basepri: u8) -> Option<u16> {
        nvic.next_exception(Masks { ipsr: 0, primask, faultmask, basepri })
    }

    #[test]
    fn the_most_urgent_wins_and_only_more_urgent_ones_preempt() {
        let mut nvic = Nvic::new(3);
        assert!(nvic.write(0x100, 0b11, 4));
        assert!(nvic.write(0x400, 0x2040, 4));
        nvic.pending.set(16, true);
        assert_eq!(next(&nvic, false, false, 0), Some(16));
        nvic.pending.set(17, true);
        assert_eq!(next(&nvic, false, false, 0), Some(17));
        assert_eq!(next(&nvic, true, false, 0), None);
        assert!(nvic.wakes(0));
        assert_eq!(next(&nvic, false, false, 0x20), None);
        nvic.pending.set(17, false);
        nvic.active.set(17, true);
        assert_eq!(next(&nvic, false, false, 0), None);
    }

    #[test]
    fn missing_priority_bits_read_as_zero() {
        let mut nvic = Nvic::new(2);
        assert!(nvic.write(0xd23, 0xff, 1));
        assert_eq!(nvic.read(0xd20), Some(0xc000_0000));
    }
}
