//! How every image that is measured ends: in one of two functions, which the simulator stops at.

use core::hint::black_box;
use core::panic::PanicInfo;

/// Where the image ends up when all went well.
#[inline(never)]
#[unsafe(no_mangle)]
pub fn finished() -> ! {
    loop {
        black_box(());
    }
}

/// Where it ends up otherwise.
#[inline(never)]
#[unsafe(no_mangle)]
pub fn failed() -> ! {
    loop {
        black_box(1);
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    failed()
}
