//! How many cycles each instruction takes, a model for each core. What is modelled, from which sources and how well
//! it agrees with published measurements is in docs/CYCLES.md; each rule here names its source.
//!
//! Sources, by the names that the rules use:
//! - *M0+ TRM*: Arm DDI 0484C, Cortex-M0+ Technical Reference Manual, table 3-1.
//! - *M0 TRM*: Arm DDI 0432C, Cortex-M0 Technical Reference Manual, table 3-1.
//! - *M3 TRM*: Arm DDI 0337H, Cortex-M3 Technical Reference Manual, table 3-1 and section 3.3.2.
//! - *M4 TRM*: Arm DDI 0439B, Cortex-M4 Technical Reference Manual, table 3-1 and section 3.3.2.
//! - *pipetest*: measurements on STM32F103, STM32F407, RP2350 and STM32H743 by J. K. (github jnk0le/random,
//!   "pipeline cycle test").
//! - *Yiu*: J. Yiu, "The Definitive Guide to Arm Cortex-M3 and Cortex-M4 Processors", 3rd edition, chapter 8.

mod m0;
mod m33;
mod m3m4;
mod m7;
mod model;
mod untimed;

pub use m0::M0;
pub use m3m4::M3M4;
pub use m7::M7;
pub use m33::M33;
pub use model::{ExceptionCycles, Timing};
pub use untimed::Untimed;

use crate::cores::Core;

/// The timing model of a core, with what is in its pipeline.
#[derive(Clone, Debug)]
pub(crate) enum Model {
    M0(M0<false>),
    M0Plus(M0<true>),
    M3(M3M4<false>),
    M4(M3M4<true>),
    M33(M33),
    M7(Box<M7>),
    Untimed(Untimed),
}

impl Model {
    /// The model of `core`, with an empty pipeline.
    pub fn of(core: Core) -> Self {
        match core {
            Core::M0 => Self::M0(M0::new(false)),
            Core::M0Plus => Self::M0Plus(M0::new(false)),
            Core::M0PlusSlow => Self::M0Plus(M0::new(true)),
            Core::M3 => Self::M3(M3M4::default()),
            Core::M4 => Self::M4(M3M4::default()),
            Core::M33 => Self::M33(M33::default()),
            Core::M7 => Self::M7(Box::default()),
            Core::Untimed => Self::Untimed(Untimed),
        }
    }
}
