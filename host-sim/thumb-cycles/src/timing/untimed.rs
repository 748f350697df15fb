//! No timing: what the simulator itself costs the host.

use super::model::{ExceptionCycles, Timing};
use crate::insn::Insn;
use crate::outcome::Outcome;

/// One cycle for every instruction: to see what timing costs the host.
#[derive(Clone, Copy, Debug, Default)]
pub struct Untimed;

impl Timing for Untimed {
    const EXCEPTIONS: ExceptionCycles = ExceptionCycles { entry: 0, exit: 0, tail_chain: 0 };

    #[inline]
    fn step(&mut self, _: &Insn, _: u32, _: bool, _: &Outcome) -> u32 {
        1
    }

    fn flush(&mut self) {}
}
