//! Boards: memory maps and the peripherals that come with them.

use crate::memory::Region;

/// A memory map and its peripherals. What all have: SysTick, NVIC, DWT, ITM.
#[derive(Clone, Debug)]
pub struct Board {
    /// Its name in messages.
    pub name: &'static str,
    /// Memory.
    pub regions: Vec<Region>,
    /// Where the vectors are, unless the image's symbol `__vector_table` says otherwise.
    pub vectors: u32,
    /// A CMSDK UART, if the board has one.
    pub uart: Option<UartWiring>,
    /// Bits of a priority that are there, from the top.
    pub priority_bits: u8,
}

/// Where a CMSDK UART is on a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UartWiring {
    /// First register.
    pub base: u32,
    /// Number of the receive interrupt.
    pub receive_interrupt: u16,
    /// Number of the transmit interrupt.
    pub transmit_interrupt: u16,
}

const MB: usize = 1 << 20;
const KB: usize = 1 << 10;

impl Board {
    /// QEMU's mps2-an385 and mps2-an386 (Arm AN385, AN386): M3, M4; code at 0, RAM at 0x2000_0000, 4 MB each.
    pub fn mps2() -> Self {
        Self {
            name: "mps2",
            regions: vec![
                Region::new("code memory", 0, 4 * MB, false),
                Region::new("RAM", 0x2000_0000, 4 * MB, true),
            ],
            vectors: 0,
            uart: Some(UartWiring { base: 0x4000_4000, receive_interrupt: 0, transmit_interrupt: 1 }),
            priority_bits: 8,
        }
    }

    /// QEMU's mps2-an505 (Arm AN505): M33; code at 0x1000_0000, RAM at 0x3800_0000.
    pub fn mps2_an505() -> Self {
        Self {
            name: "mps2-an505",
            regions: vec![
                Region::new("code memory", 0x1000_0000, 4 * MB, false),
                Region::new("RAM", 0x3800_0000, 4 * MB, true),
            ],
            vectors: 0x1000_0000,
            uart: Some(UartWiring { base: 0x5020_0000, receive_interrupt: 32, transmit_interrupt: 33 }),
            priority_bits: 8,
        }
    }

    /// QEMU's microbit (nRF51822): M0; 256 KB flash at 0, 16 KB RAM at 0x2000_0000.
    pub fn microbit() -> Self {
        Self {
            name: "microbit",
            regions: vec![
                Region::new("flash", 0, 256 * KB, false),
                Region::new("RAM", 0x2000_0000, 16 * KB, true),
            ],
            vectors: 0,
            uart: None,
            priority_bits: 2,
        }
    }

    /// Like an RP2040: flash at 0x1000_0000, 264 KB RAM at 0x2000_0000; the image starts at its vectors, without the
    /// boot ROM.
    pub fn rp2040() -> Self {
        Self {
            name: "rp2040",
            regions: vec![
                Region::new("flash", 0x1000_0000, 2 * MB, false),
                Region::new("RAM", 0x2000_0000, 264 * KB, true),
            ],
            vectors: 0x1000_0100,
            uart: None,
            priority_bits: 2,
        }
    }

    /// No chip in particular: 1 MB flash at 0, 256 KB RAM at 0x2000_0000, both without wait states.
    pub fn bare() -> Self {
        Self {
            name: "bare",
            regions: vec![
                Region::new("flash", 0, MB, false),
                Region::new("RAM", 0x2000_0000, 256 * KB, true),
            ],
            vectors: 0,
            uart: None,
            priority_bits: 3,
        }
    }
}
