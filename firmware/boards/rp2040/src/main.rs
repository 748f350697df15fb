//! Raspberry Pi Pico and Pico 2: the servo bus on UART 0, a host on UART 1, hobby servos on a PCA9685 on I2C 0 and on eight PWM
//! pins, the trigger on a pin. What is wired where is in README.md.
#![no_std]
#![no_main]

mod clips;

use board_support::{Busy, Hobby, Host, IdleLine, Puppet, Wiring, buffers, host_buffers};
use clips::{LAYOUT, flash};
use embassy_executor::Spawner;
use embassy_rp::bind_interrupts;
use embassy_rp::clocks::clk_sys_freq;
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::i2c::{self, I2c};
use embassy_rp::peripherals::{I2C0, UART0, UART1};
use embassy_rp::pwm::{self, Pwm, PwmOutput};
use embassy_rp::uart::{BufferedInterruptHandler, BufferedUart, Config, Error};
use embassy_rp::watchdog::Watchdog;
use embassy_time::Duration;
use embedded_io_async::{ErrorType, Read, Write};
use firmware::device::Identity;
use firmware::machine::Start;
use firmware::map::BusKind;
use servo_wire::port::LineConfig;
use servo_wire::pwm::{COUNTS_HZ, PwmTiming};

bind_interrupts!(struct Interrupts {
    UART0_IRQ => BufferedInterruptHandler<UART0>;
    UART1_IRQ => BufferedInterruptHandler<UART1>;
    I2C0_IRQ => i2c::InterruptHandler<I2C0>;
});

/// Silence of the player after which the controller starts again.
const WATCHDOG: Duration = Duration::from_millis(500);

/// Bits per second on the way to the PCA9685.
const I2C_HZ: u32 = 400_000;

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
    let i2c = puppet.rate_of(BusKind::Pca9685).map(|_| {
        let mut config = i2c::Config::default();
        config.frequency = I2C_HZ;
        I2c::new_async(chip.I2C0, chip.PIN_9, chip.PIN_8, Interrupts, config)
    });
    let pwm = puppet.rate_of(BusKind::Pwm).and_then(PwmTiming::of).and_then(|timing| {
        let config = counting(timing);
        let slices = [
            Pwm::new_output_ab(chip.PWM_SLICE5, chip.PIN_10, chip.PIN_11, config.clone()),
            Pwm::new_output_ab(chip.PWM_SLICE6, chip.PIN_12, chip.PIN_13, config.clone()),
            Pwm::new_output_ab(chip.PWM_SLICE7, chip.PIN_14, chip.PIN_15, config.clone()),
            Pwm::new_output_ab(chip.PWM_SLICE0, chip.PIN_16, chip.PIN_17, config),
        ];
        Some((outputs(slices)?, timing))
    });
    let hobby = Hobby { i2c, pwm };
    watchdog.start(WATCHDOG);
    let wiring = Wiring {
        uart: IdleLine::new(Uart(uart), baud),
        direction: Output::new(chip.PIN_2, Level::Low),
        line: LineConfig::uart(baud),
        trigger: Input::new(chip.PIN_3, Pull::Up),
        feed: || watchdog.feed(WATCHDOG),
        start,
        simulated: false,
    };
    puppet.serve(wiring, host, hobby).await;
}

/// How a slice counts, with no pulse yet.
fn counting(timing: PwmTiming) -> pwm::Config {
    let mut config = pwm::Config::default();
    // 50 or 60, which fit.
    config.divider = ((clk_sys_freq() / COUNTS_HZ) as u8).into();
    config.top = timing.top;
    config
}

/// Both pins of each slice, which has them.
fn outputs(slices: [Pwm<'static>; 4]) -> Option<[PwmOutput<'static>; 8]> {
    let [(a, b), (c, d), (e, f), (g, h)] = slices.map(Pwm::split);
    Some([a?, b?, c?, d?, e?, f?, g?, h?])
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
