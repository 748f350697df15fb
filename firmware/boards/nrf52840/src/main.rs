//! nRF52840 DK: the servo bus on UARTE 0, a host on UARTE 1, the trigger on button 1. What is wired where is in README.md.
//!
//! Between ticks and bytes the core sleeps by WFE, and time is RTC 1's.
#![no_std]
#![no_main]

mod clips;

use board_support::{Hobby, Host, Puppet, Wiring, buffers, host_buffers};
use clips::{LAYOUT, flash};
use core::ptr::{read_volatile, write_volatile};
use embassy_executor::Spawner;
use embassy_nrf::bind_interrupts;
use embassy_nrf::buffered_uarte::{BufferedUarte, InterruptHandler};
use embassy_nrf::config::{Config, HfclkSource, LfclkSource};
use embassy_nrf::gpio::{Input, Level, Output, OutputDrive, Pull};
use embassy_nrf::peripherals::{UARTE0, UARTE1};
use embassy_nrf::uarte::{self, Baudrate};
use embassy_nrf::wdt::{self, Watchdog};
use firmware::device::Identity;
use firmware::machine::Start;
use servo_wire::port::LineConfig;

bind_interrupts!(struct Interrupts {
    UARTE0 => InterruptHandler<UARTE0>;
    UARTE1 => InterruptHandler<UARTE1>;
});

/// Silence of the player after which the controller starts again, in 1/32768 s.
const WATCHDOG_TICKS: u32 = 32_768 / 2;

/// The core's clock, which is always that.
const CLOCK_HZ: u32 = 64_000_000;

/// RESETREAS (nRF52840 Product Specification, POWER): why the controller was reset; ones are written to forget.
const RESETREAS: *mut u32 = 0x4000_0400 as *mut u32;
const WATCHDOG: u32 = 1 << 1;
const LOCKUP: u32 = 1 << 3;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let start = start();
    let chip = embassy_nrf::init(clocks());
    let mut puppet = Puppet::linked_in();
    let mut config = uarte::Config::default();
    config.baudrate = baudrate(puppet.baud());
    let (sent, received) = buffers();
    let uart = BufferedUarte::new(
        chip.UARTE0,
        chip.TIMER0,
        chip.PPI_CH0,
        chip.PPI_CH1,
        chip.PPI_GROUP0,
        chip.P1_01,
        chip.P1_02,
        Interrupts,
        config,
        received,
        sent,
    );
    // Its own rate is 115,200 bit/s.
    let (sent, received) = host_buffers();
    let host_line = BufferedUarte::new(
        chip.UARTE1,
        chip.TIMER1,
        chip.PPI_CH2,
        chip.PPI_CH3,
        chip.PPI_GROUP1,
        chip.P0_08,
        chip.P0_06,
        Interrupts,
        uarte::Config::default(),
        received,
        sent,
    );
    let identity = Identity {
        name: "nRF52840 DK".try_into().unwrap_or_default(),
        clock_hz: CLOCK_HZ,
        data_bytes: 512,
        flash_stalls: true,
    };
    let host = Host { line: host_line, store: Some((flash(chip.NVMC), LAYOUT)), identity };
    let mut config = wdt::Config::default();
    config.timeout_ticks = WATCHDOG_TICKS;
    let Ok((_watchdog, [mut handle])) = Watchdog::try_new(chip.WDT, config) else {
        defmt::panic!("another watchdog runs");
    };
    let line = LineConfig::uart(puppet.baud());
    let wiring = Wiring {
        uart,
        direction: Output::new(chip.P1_03, Level::Low, OutputDrive::Standard),
        line,
        trigger: Input::new(chip.P0_11, Pull::Up),
        feed: || handle.pet(),
        start,
        simulated: false,
    };
    puppet.serve(wiring, host, Hobby::NONE).await;
}

/// Both crystals and the DC/DC converter of the DK. The UART needs the fast crystal: the internal oscillator may be 8 % off.
fn clocks() -> Config {
    let mut config = Config::default();
    config.hfclk_source = HfclkSource::ExternalXtal;
    config.lfclk_source = LfclkSource::ExternalXtal;
    config.dcdc.reg1 = true;
    config
}

/// The UART divides its clock by few numbers only.
fn baudrate(baud: u32) -> Baudrate {
    match baud {
        9_600 => Baudrate::Baud9600,
        57_600 => Baudrate::Baud57600,
        115_200 => Baudrate::Baud115200,
        1_000_000 => Baudrate::Baud1m,
        _ => defmt::panic!("{} baud, expected 9600, 57600, 115200 or 1000000", baud),
    }
}

/// Why the controller started. A brown-out looks like power on.
fn start() -> Start {
    // SAFETY: a register that is always there, and nobody else uses it yet.
    let reasons = unsafe {
        let reasons = read_volatile(RESETREAS);
        write_volatile(RESETREAS, reasons);
        reasons
    };
    if reasons & (WATCHDOG | LOCKUP) != 0 { Start::ByItself } else { Start::Power }
}
