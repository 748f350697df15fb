//! Plays the linked-in clip on the servos of the linked-in map, once, and ends the simulation.
#![no_std]
#![no_main]

mod exit;
mod time;
mod uart;

use board_support::{Button, Puppet, Wiring};
use embassy_executor::Spawner;
use firmware::machine::Start;
use servo_wire::port::{Automatic, LineConfig};

/// How late servos may answer. Those of QEMU live in another process on a machine that has other things to do; nothing
/// here waits that long unless one is missing.
const SLACK_US: u32 = 2_000_000;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let Some(core) = cortex_m::Peripherals::take() else {
        defmt::panic!("the core's peripherals are in use");
    };
    time::start(core.SYST);
    let mut puppet = Puppet::linked_in();
    let uart = match uart::Uart::new(core.NVIC, puppet.baud()) {
        Ok(uart) => uart,
        Err(error) => defmt::panic!("bus: {}", error),
    };
    let wiring = Wiring {
        uart,
        direction: Automatic,
        line: LineConfig { slack_us: SLACK_US, ..LineConfig::uart(puppet.baud()) },
        trigger: Button::None,
        feed: || {},
        start: Start::Power,
        simulated: true,
    };
    match puppet.play(wiring).await {
        None => exit::success(),
        Some(_) => exit::failure(),
    }
}
