#![doc = include_str!("../README.md")]
//!
//! # Where to start
//!
//! [`Image`] is an ELF file or some halfwords, [`Board`] a memory map, [`Core`] a core; [`Machine`] is all three
//! together. [`Machine::run_until`], [`Machine::call_function`] and [`Machine::run_to_exit`] run it, [`Machine::usage`],
//! [`Machine::self_cycles`] and [`Machine::call_paths`] say what that has cost. [`Core::evidence`] is a sentence to print
//! beside figures.
//!
//! An instruction is decoded once ([`decode`]), executed, and given to the core's model of its pipeline ([`timing`]).
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
