//! Black Pill: the servo bus on USART 1, a host on USART 2, the trigger on the button KEY. What is wired where is in README.md.
#![no_std]
#![no_main]

use board_support::{Hobby, Host, NoFlash, Puppet, Wiring, buffers, host_buffers};
use core::ptr::{read_volatile, write_volatile};
use embassy_executor::Spawner;
use embassy_stm32::bind_interrupts;
use embassy_stm32::gpio::{Input, Level, Output, Pull, Speed};
use embassy_stm32::peripherals::{USART1, USART2};
use embassy_stm32::rcc::{APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{BufferedInterruptHandler, BufferedUart, Config};
use embassy_stm32::wdg::IndependentWatchdog;
use firmware::device::Identity;
use firmware::machine::Start;
use servo_wire::port::LineConfig;

bind_interrupts!(struct Interrupts {
    USART1 => BufferedInterruptHandler<USART1>;
    USART2 => BufferedInterruptHandler<USART2>;
});

/// Silence of the player after which the controller starts again.
const WATCHDOG_US: u32 = 500_000;

/// The core's clock, as `clocks` sets it up.
const CLOCK_HZ: u32 = 100_000_000;

/// Bits per second of the host's line.
const HOST_BAUD: u32 = 115_200;

/// RCC_CSR (RM0383): why the controller was reset.
const RCC_CSR: *mut u32 = 0x4002_3874 as *mut u32;
const REMOVE_FLAGS: u32 = 1 << 24;
const BROWN_OUT: u32 = 1 << 25;
const POWER_ON: u32 = 1 << 27;
const WATCHDOGS: u32 = 1 << 29 | 1 << 30;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let start = start();
    let chip = embassy_stm32::init(clocks());
    let mut puppet = Puppet::linked_in();
    let baud = puppet.baud();
    let mut config = Config::default();
    config.baudrate = baud;
    let (sent, received) = buffers();
    let uart = BufferedUart::new(chip.USART1, chip.PA10, chip.PA9, sent, received, Interrupts, config);
    let uart = match uart {
        Ok(uart) => uart,
        Err(error) => defmt::panic!("{} baud: {}", baud, defmt::Debug2Format(&error)),
    };
    let mut config = Config::default();
    config.baudrate = HOST_BAUD;
    let (sent, received) = host_buffers();
    let host_line = BufferedUart::new(chip.USART2, chip.PA3, chip.PA2, sent, received, Interrupts, config);
    let host_line = match host_line {
        Ok(line) => line,
        Err(error) => defmt::panic!("{} baud: {}", HOST_BAUD, defmt::Debug2Format(&error)),
    };
    let identity = Identity {
        name: "Black Pill".try_into().unwrap_or_default(),
        clock_hz: CLOCK_HZ,
        data_bytes: 512,
        flash_stalls: false,
    };
    // Erasing a sector of its flash would stop everything for longer than both watchdogs bear.
    let host = Host { line: host_line, store: None::<(NoFlash, _)>, identity };
    let mut watchdog = IndependentWatchdog::new(chip.IWDG, WATCHDOG_US);
    watchdog.unleash();
    let wiring = Wiring {
        uart,
        direction: Output::new(chip.PA8, Level::Low, Speed::Low),
        line: LineConfig::uart(baud),
        trigger: Input::new(chip.PA0, Pull::Up),
        feed: || watchdog.pet(),
        start,
        simulated: false,
    };
    puppet.serve(wiring, host, Hobby::NONE).await;
}

/// 100 MHz from the Black Pill's crystal of 25 MHz.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(25_000_000), mode: HseMode::Oscillator });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV25,
        mul: PllMul::MUL200,
        divp: Some(PllPDiv::DIV2),
        divq: None,
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.apb1_pre = APBPrescaler::DIV2;
    config
}

/// Why the controller started. A brown-out is told from power on only where the option bytes turn its reset on.
fn start() -> Start {
    // SAFETY: a register that is always there, and nobody else uses it yet. Writing the bit forgets the reasons.
    let reasons = unsafe {
        let reasons = read_volatile(RCC_CSR);
        write_volatile(RCC_CSR, reasons | REMOVE_FLAGS);
        reasons
    };
    let browned_out = reasons & (BROWN_OUT | POWER_ON) == BROWN_OUT;
    if browned_out || reasons & WATCHDOGS != 0 { Start::ByItself } else { Start::Power }
}
