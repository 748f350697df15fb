//! What a memory-mapped device has to answer.

/// A memory-mapped device: a timer, a serial port, a converter.
///
/// [`Machine::attach`](crate::Machine::attach) puts one on the bus. Time is the number of cycles since reset, and every
/// method is told it: a device needs no clock of its own. A device that does nothing by itself implements
/// [`read`](Self::read) and [`write`](Self::write) only.
///
/// ```
/// use thumb_cycles::Peripheral;
///
/// /// Counts down from the number that is written to it, one a cycle.
/// #[derive(Default)]
/// struct Countdown {
///     zero_at: u64,
/// }
///
/// impl Peripheral for Countdown {
///     fn read(&mut self, _offset: u32, now: u64) -> u32 {
///         self.zero_at.saturating_sub(now) as u32
///     }
///     fn write(&mut self, _offset: u32, value: u32, _bytes: u32, now: u64) {
///         self.zero_at = now + u64::from(value);
///     }
/// }
///
/// let mut countdown = Countdown::default();
/// countdown.write(0, 100, 4, 1_000);
/// assert_eq!(countdown.read(0, 1_030), 70);
/// ```
pub trait Peripheral: Send {
    /// The 32-bit register at `offset`, a multiple of 4, from the device's first register. A narrower load gets the
    /// bytes that it asks for out of this word.
    fn read(&mut self, offset: u32, now: u64) -> u32;

    /// A store of the low `bytes` (1, 2 or 4) bytes of `value` at `offset` from the device's first register.
    fn write(&mut self, offset: u32, value: u32, bytes: u32, now: u64);

    /// Brings the device to the cycle `now`, and says what it does to the rest of the chip. It is called between two
    /// instructions, at the latest at the cycle that [`next_event`](Self::next_event) named.
    fn advance(&mut self, now: u64) -> Signals {
        let _ = now;
        Signals::default()
    }

    /// The next cycle after `now` at which the device does something by itself, if it does.
    fn next_event(&self, now: u64) -> Option<u64> {
        let _ = now;
        None
    }

    /// Bytes that come in from outside of the chip, from the cycle `now` on.
    fn receive(&mut self, bytes: &[u8], now: u64) {
        let _ = (bytes, now);
    }
}

/// What a device does to the rest of the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// Interrupt lines that ask for an interrupt now, a bit each: bit 0 is the first line. A line that stays up asks
    /// each time; a pulse asks once.
    pub interrupts: u32,
    /// A byte that the device has sent out of the chip.
    pub sent: Option<u8>,
}
