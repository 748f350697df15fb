//! Every way to end: QEMU exits with 0 after the clip and with 1 after anything else.

use core::panic::PanicInfo;
use cortex_m_rt::{ExceptionFrame, exception};
use defmt_semihosting as _;
use semihosting::process;

/// Ends the simulation: the clip was played.
pub fn success() -> ! {
    process::exit(0)
}

/// Ends the simulation: what failed has been logged.
pub fn failure() -> ! {
    process::exit(1)
}

/// `defmt::panic!` has already said why.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    failure()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    failure()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", frame.pc(), frame.lr());
    failure()
}
