//! Machines to simulate: a core and its memory map.

use crate::insn::Arch;
use crate::memory::Region;

/// A core whose timing is modelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Core {
    /// Cortex-M0 with the single-cycle multiplier.
    M0,
    /// Cortex-M0+ with the single-cycle multiplier.
    M0Plus,
    /// Cortex-M0+ with the small multiplier: 32 cycles.
    M0PlusSlow,
    /// Cortex-M3.
    M3,
    /// Cortex-M4.
    M4,
    /// Cortex-M33.
    M33,
    /// Cortex-M7: an estimate.
    M7,
    /// An M4 whose instructions take a cycle each: what the simulator does without a timing model.
    Untimed,
}

impl Core {
    /// All that model a real core.
    pub const ALL: [Self; 7] =
        [Self::M0, Self::M0Plus, Self::M0PlusSlow, Self::M3, Self::M4, Self::M33, Self::M7];

    /// As in commands: `cortex-m0plus`.
    pub fn name(self) -> &'static str {
        match self {
            Self::M0 => "cortex-m0",
            Self::M0Plus => "cortex-m0plus",
            Self::M0PlusSlow => "cortex-m0plus-slow-multiplier",
            Self::M3 => "cortex-m3",
            Self::M4 => "cortex-m4",
            Self::M33 => "cortex-m33",
            Self::M7 => "cortex-m7",
            Self::Untimed => "untimed",
        }
    }

    /// The core with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|core| core.name() == name)
    }

    /// Its instructions.
    pub fn arch(self) -> Arch {
        match self {
            Self::M0 | Self::M0Plus | Self::M0PlusSlow => Arch::V6M,
            Self::M3 => Arch::V7M,
            Self::M4 | Self::M7 | Self::Untimed => Arch::V7EM,
            Self::M33 => Arch::V8M,
        }
    }

    /// Rust's target for it, without FPU.
    pub fn target(self) -> &'static str {
        match self.arch() {
            Arch::V6M => "thumbv6m-none-eabi",
            Arch::V7M => "thumbv7m-none-eabi",
            Arch::V7EM => "thumbv7em-none-eabi",
            Arch::V8M => "thumbv8m.main-none-eabi",
        }
    }

    /// How far its cycle counts may be off, as a fraction, with memory that answers at once; docs/CYCLES.md says how
    /// that is known. `None` where nothing but one cycle an instruction is counted.
    pub fn tolerance(self) -> Option<f64> {
        match self {
            Self::M0 | Self::M0Plus | Self::M0PlusSlow => Some(0.015),
            Self::M3 | Self::M4 => Some(0.03),
            Self::M33 => Some(0.05),
            Self::M7 => Some(0.15),
            Self::Untimed => None,
        }
    }
}

/// A memory map and its peripherals. What all have: SysTick, NVIC, DWT, ITM.
#[derive(Clone, Debug)]
pub struct Board {
    /// Its name in messages.
    pub name: &'static str,
    /// Memory.
    pub regions: Vec<Region>,
    /// Where the vectors are, unless the image's symbol `__vector_table` says otherwise.
    pub vectors: u32,
    /// First register of a CMSDK UART and the numbers of its receive and transmit interrupts.
    pub uart: Option<(u32, u16, u16)>,
    /// Bits of a priority that are there, from the top.
    pub priority_bits: u8,
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
            uart: Some((0x4000_4000, 0, 1)),
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
            uart: Some((0x5020_0000, 32, 33)),
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
