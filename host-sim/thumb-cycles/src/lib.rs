//! A simulated Cortex-M that counts cycles: runs the ELF file that was built for the chip, and says what it costs.
//!
//! [`Image`] is an ELF file, [`Board`] a memory map, [`Core`] a core; [`Machine`] is all three together. Each
//! instruction is decoded once ([`decode`]), executed, and given to the core's model of its pipeline ([`timing`]).
//! What the models know, from where, and how well they agree with measurements is in docs/CYCLES.md.
//!
//! Runs are alike: nothing depends on the host's clock. Not simulated: FPU, MPU, TrustZone, faults that the image
//! handles itself (a fault ends the simulation and says where), DMA, and peripherals other than the core's own and a
//! UART.

#![forbid(unsafe_code)]

mod arith;
mod board;
mod bus;
mod call_tree;
mod clock;
mod cores;
mod cpu;
mod cycle_counter;
pub mod decode;
mod error;
mod exception;
mod execute;
mod execute_dsp;
mod fault;
mod image;
pub mod insn;
mod machine;
mod memory;
mod nvic;
mod outcome;
mod peripheral;
mod profile;
mod run;
mod semihosting;
mod stop;
mod system;
mod system_registers;
mod systick;
pub mod timing;
mod transfer;
mod trap;
mod uart;
mod wait_states;

pub use board::{Board, UartWiring};
pub use cores::Core;
pub use cpu::{Cpu, Flags};
pub use error::Error;
pub use fault::{AccessError, Cause, Fault};
pub use image::{Function, Image};
pub use machine::Machine;
pub use memory::{Memory, Region};
pub use outcome::Outcome;
pub use peripheral::{Peripheral, Signals};
pub use profile::{CallPath, SelfCycles};
pub use semihosting::{Files, Semihosting};
pub use stop::{Stop, Usage};
pub use uart::CmsdkUart;
pub use wait_states::WaitStates;
