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

    /// How far its cycle counts may be off, as a fraction, with memory that answers at once. [`evidence`](Self::evidence)
    /// says what that rests on. `None` where nothing but one cycle an instruction is counted.
    pub fn tolerance(self) -> Option<f64> {
        match self {
            Self::M0 | Self::M0Plus | Self::M0PlusSlow => Some(0.015),
            Self::M3 | Self::M4 => Some(0.03),
            Self::M33 => Some(0.05),
            Self::M7 => Some(0.15),
            Self::Untimed => None,
        }
    }

    /// What its cycle counts were compared with: a sentence to print beside figures.
    ///
    /// ```
    /// use thumb_cycles::Core;
    ///
    /// assert!(Core::M0Plus.evidence().contains("never compared with a chip"));
    /// ```
    pub fn evidence(self) -> &'static str {
        match self {
            Self::M0 => {
                "cortex-m0: compared with counts by hand, and with an STM32F0 in one published function (-1.0 %); \
                 exceptions and wait states were never compared with a chip"
            }
            Self::M0Plus => {
                "cortex-m0plus: compared with counts by hand and with the emulator rp2040js (0 %), \
                 never compared with a chip"
            }
            Self::M0PlusSlow => {
                "cortex-m0plus-slow-multiplier: compared with counts by hand only, never compared with a chip"
            }
            Self::M3 => {
                "cortex-m3: compared with counts by hand, and with an STM32F1 in one published function (-0.5 %); \
                 exceptions and wait states were never compared with a chip"
            }
            Self::M4 => {
                "cortex-m4: compared with counts by hand, with an nRF52840 in four published functions \
                 (-1.9 to +1.0 %), and with an STM32F4 in one (-0.3 %); exceptions were never compared with a chip"
            }
            Self::M33 => {
                "cortex-m33: compared with counts by hand, and with an RP2350 in one published function (0.0 %); \
                 jumps to a register, exceptions and wait states were never compared with a chip"
            }
            Self::M7 => {
                "cortex-m7: an estimate, compared with an STM32H743 in one published loop (+3.7 %) and nothing else"
            }
            Self::Untimed => "untimed: counts instructions, not cycles",
        }
    }
}
