//! The end of a real board's image: it says why by RTT and waits for the watchdog, after which the puppet holds still until
//! someone acknowledges ([`Start::ByItself`](firmware::machine::Start::ByItself)). Before the watchdog runs, it waits for ever.

use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _;

fn wait_for_watchdog() -> ! {
    cortex_m::interrupt::disable();
    loop {
        cortex_m::asm::wfi();
    }
}

/// `defmt::panic!` has already said why.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    wait_for_watchdog()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    wait_for_watchdog()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", frame.pc(), frame.lr());
    wait_for_watchdog()
}
