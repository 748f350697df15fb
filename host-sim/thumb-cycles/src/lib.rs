//! A simulated Cortex-M that counts cycles: runs the ELF file that was built for the chip, and says what it costs.
//!
//! [`Image`] is an ELF file, [`Board`] a memory map, [`Core`] a core; [`Machine`] is all three together. Each
//! instruction is decoded once ([`decode`]), executed, and given to the core's model of its pipeline ([`timing`]).
//! What the models know, from where, and how well they agree with measurements is in docs/CYCLES.md.
//!
//! Runs are alike: nothing depends on the host's clock. Not simulated: FPU, MPU, TrustZone, faults that the image
//! handles itself (a fault ends the simulation and says where), DMA, and peripherals other than the core's own and a
//! UART.

mod arith;
mod board;
mod calls;
mod cpu;
pub mod decode;
mod exception;
mod execute;
mod fault;
mod flash;
mod image;
pub mod insn;
mod machine;
mod memory;
mod nvic;
mod peripherals;
mod profile;
mod semihosting;
mod step;
mod systick;
pub mod timing;
mod transfer;
mod uart;

pub use board::{Board, Core};
pub use cpu::{Cpu, Flags};
pub use fault::{Cause, Fault};
pub use image::{Function, Image};
pub use machine::{Machine, Outcome, Stop, Usage};
pub use memory::{AccessError, Memory, Region, WaitStates};
pub use profile::{CallPath, SelfCycles};
pub use semihosting::Files;

#[cfg(test)]
mod tests;
