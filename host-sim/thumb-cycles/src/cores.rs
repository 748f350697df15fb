//! The cores that are simulated.

use crate::insn::Arch;

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
