//! Raspberry Pi Pico and Pico 2: the servo bus on UART 0, a host on UART 1, the trigger on a pin. What is wired where is in
//! README.md.
#![no_std]
#![no_main]

mod clips;

use board_support::{Busy, Host, IdleLine, Puppet, Wiring, buffers, host_buffers};
use clips::{LAYOUT, flash};
use embassy_executor::Spawner;
use embassy_rp::bind_interrupts;
use embassy_rp::clocks::clk_sys_freq;
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::peripherals::{UART0, UART1};
use embassy_rp::uart::{BufferedInterruptHandler, BufferedUart, Config, Error};
use embassy_rp::watchdog::Watchdog;
use embassy_time::Duration;
use embedded_io_async::{ErrorType, Read, Write};
use firmware::bus::port::Line;
use firmware::device::Identity;
use firmware::machine::Start;

bind_interrupts!(struct Interrupts {
    UART0_IRQ => BufferedInterruptHandler<UART0>;
    UART1_IRQ => BufferedInterruptHandler<UART1>;
});

/// Silence of the player after which the controller starts again.
const WATCHDOG: Duration = Duration::from_millis(500);

/// Bits per second of the host's line.
const HOST_BAUD: u32 = 115_200;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let chip = embassy_rp::init(embassy_rp::config::Config::default());
    let mut watchdog = Watchdog::new(chip.WATCHDOG);
    let start = if watchdog.reset_reason().is_some() { Start::ByItself } else { Start::Power };
    let mut puppet = Puppet::linked_in();
    let baud = puppet.baud();
    let mut config = Config::default();
    config.baudrate = baud;
    let (sent, received) = buffers();
    let uart = BufferedUart::new(chip.UART0, chip.PIN_0, chip.PIN_1, Interrupts, sent, received, config);
    let mut config = Config::default();
    config.baudrate = HOST_BAUD;
    let (sent, received) = host_buffers();
    let line = BufferedUart::new(chip.UART1, chip.PIN_4, chip.PIN_5, Interrupts, sent, received, config);
    let identity = Identity {
        name: "Pico".try_into().unwrap_or_default(),
        clock_hz: clk_sys_freq(),
        data_bytes: 512,
        flash_stalls: true,
    };
    let host = Host { line, store: Some((flash(chip.FLASH), LAYOUT)), identity };
    watchdog.start(WATCHDOG);
    let wiring = Wiring {
        uart: IdleLine::new(Uart(uart), baud),
        direction: Output::new(chip.PIN_2, Level::Low),
        line: Line::uart(baud),
        trigger: Input::new(chip.PIN_3, Pull::Up),
        feed: || watchdog.feed(WATCHDOG),
        start,
        simulated: false,
    };
    puppet.serve(wiring, host).await;
}

/// embassy's UART, whose flush returns while its FIFO holds up to 32 bytes.
struct Uart(BufferedUart);

impl Busy for Uart {
    fn busy(&self) -> bool {
        self.0.busy()
    }
}

impl ErrorType for Uart {
    type Error = Error;
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        self.0.read(bytes).await
    }
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        self.0.write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), Error> {
        self.0.flush().await
    }
}
