//! Everything that a core can load from and store to: memory, its own registers, and peripherals.

use crate::clock::Clock;
use crate::error::Error;
use crate::fault::AccessError;
use crate::memory::Memory;
use crate::nvic::{Masks, interrupt_exception};
use crate::peripheral::Peripheral;
use crate::system_registers::SystemRegisters;

/// Interrupt numbers that the controller has.
const INTERRUPTS: u16 = 240;

/// A peripheral and where it is.
struct Attached {
    base: u32,
    bytes: u32,
    /// The interrupt of each of its lines.
    interrupts: Vec<u16>,
    peripheral: Box<dyn Peripheral>,
}

impl Attached {
    fn contains(&self, address: u32) -> bool {
        address.wrapping_sub(self.base) < self.bytes
    }
}

/// Memory, the core's own registers, peripherals, and the clock that they share.
pub(crate) struct Bus {
    pub memory: Memory,
    pub system: SystemRegisters,
    pub clock: Clock,
    attached: Vec<Attached>,
}

impl Bus {
    pub fn new(memory: Memory, system: SystemRegisters) -> Self {
        Self { memory, system, clock: Clock::default(), attached: Vec::new() }
    }

    /// Puts a peripheral with `bytes` bytes of registers at `base`; its lines ask for `interrupts`.
    pub fn attach(
        &mut self,
        base: u32,
        bytes: u32,
        interrupts: &[u16],
        peripheral: Box<dyn Peripheral>,
    ) -> Result<(), Error> {
        let last = base.saturating_add(bytes.saturating_sub(1));
        let overlaps = |other: u32, size: u64| {
            u64::from(base) < u64::from(other) + size && u64::from(other) <= u64::from(last)
        };
        let regions = self.memory.regions().iter();
        let region = regions.map(|region| (region.name, region.base, region.data.len() as u64));
        let attached =
            self.attached.iter().map(|other| ("another peripheral", other.base, other.bytes.into()));
        let own = [("the core's own registers", 0xe000_0000, 1 << 20)];
        if let Some((other, ..)) =
            region.chain(attached).chain(own).find(|&(_, base, size)| overlaps(base, size))
        {
            return Err(Error::PeripheralOverlaps { address: base, bytes, other });
        }
        let highest = interrupts.iter().copied().max().unwrap_or(0);
        if interrupts.len() > 32 || highest >= INTERRUPTS {
            return Err(Error::NoSuchInterrupt { address: base, lines: interrupts.len(), highest });
        }
        self.attached.push(Attached { base, bytes, interrupts: interrupts.to_vec(), peripheral });
        self.clock.expire();
        Ok(())
    }

    /// Reads `N` bytes; `masks` is what the core tells its own registers.
    #[inline]
    pub fn read<const N: usize>(
        &mut self,
        address: u32,
        masks: impl Fn() -> Masks,
    ) -> Result<u32, AccessError> {
        match self.memory.read::<N>(address) {
            Some(bytes) => {
                let mut word = [0; 4];
                for (to, from) in word.iter_mut().zip(bytes) {
                    *to = from;
                }
                Ok(u32::from_le_bytes(word))
            }
            None => self.read_register(address, N as u32, masks()),
        }
    }

    /// Writes the low `N` bytes of `value`.
    #[inline]
    pub fn write<const N: usize>(&mut self, address: u32, value: u32) -> Result<(), AccessError> {
        let mut bytes = [0; N];
        for (to, from) in bytes.iter_mut().zip(value.to_le_bytes()) {
            *to = from;
        }
        match self.memory.write(address, bytes) {
            Err(AccessError::Unmapped) => self.write_register(address, value, N as u32),
            written => written,
        }
    }

    #[cold]
    fn read_register(&mut self, address: u32, bytes: u32, masks: Masks) -> Result<u32, AccessError> {
        let (word_address, now) = (address & !3, self.clock.now);
        let word = match self.attached.iter_mut().find(|attached| attached.contains(address)) {
            Some(attached) => Some(attached.peripheral.read(word_address.wrapping_sub(attached.base), now)),
            None => self.system.read(word_address, masks, now),
        };
        let shifted = word.ok_or(AccessError::Unmapped)? >> ((address & 3) * 8);
        Ok(if bytes == 4 { shifted } else { shifted & ((1 << (bytes * 8)) - 1) })
    }

    #[cold]
    fn write_register(&mut self, address: u32, value: u32, bytes: u32) -> Result<(), AccessError> {
        let now = self.clock.now;
        match self.attached.iter_mut().find(|attached| attached.contains(address)) {
            Some(attached) => {
                attached.peripheral.write(address.wrapping_sub(attached.base), value, bytes, now);
            }
            None if self.system.write(address, value, bytes, now) => {}
            None => return Err(AccessError::Unmapped),
        }
        self.clock.expire();
        Ok(())
    }

    /// Brings SysTick and peripherals to the present cycle, and asks for their interrupts. Gives the first byte that a
    /// peripheral has sent, with the peripheral's address; what others do is seen when it is called again.
    pub fn advance(&mut self) -> Option<(u32, u8)> {
        let now = self.clock.now;
        self.system.advance(now);
        for attached in &mut self.attached {
            let signals = attached.peripheral.advance(now);
            for (line, &interrupt) in attached.interrupts.iter().enumerate() {
                if signals.interrupts & 1 << line != 0 {
                    self.system.nvic.pending.set(interrupt_exception(interrupt), true);
                }
            }
            if let Some(byte) = signals.sent {
                return Some((attached.base, byte));
            }
        }
        None
    }

    /// The next cycle at which something happens by itself.
    pub fn next_event(&self) -> Option<u64> {
        let now = self.clock.now;
        let peripherals = self.attached.iter().filter_map(|attached| attached.peripheral.next_event(now));
        peripherals.chain(self.system.next_event(now)).min()
    }

    /// Gives bytes from outside of the chip to the peripheral at `base`; `false` where there is none.
    pub fn deliver(&mut self, base: u32, bytes: &[u8]) -> bool {
        let now = self.clock.now;
        let attached = self.attached.iter_mut().find(|attached| attached.base == base);
        self.clock.expire();
        attached.map(|attached| attached.peripheral.receive(bytes, now)).is_some()
    }
}
