//! The crate `p256-cortex-m4-sys`: its authors publish the cycles that it takes on an nRF52840. The host calls the
//! functions and gives them memory.
#![no_std]
#![no_main]

use core::arch::global_asm;
use core::panic::PanicInfo;
use p256_cortex_m4_sys as p256;

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}

global_asm!(".section .vectors, \"a\"", ".word _stack_start", ".word start",);

#[unsafe(no_mangle)]
extern "C" fn start() -> ! {
    loop {}
}

/// Keeps the functions in the image.
#[used]
static FUNCTIONS: (
    unsafe extern "C" fn(*mut u32, *mut u32, *const u32) -> bool,
    unsafe extern "C" fn(*mut u8, *const u32, *const u32, *const u32) -> bool,
    unsafe extern "C" fn(*mut u32, *mut u32, *const u8, u32, *const u32, *const u32) -> bool,
    unsafe extern "C" fn(*const u32, *const u32, *const u8, u32, *const u32, *const u32) -> bool,
) = (p256::p256_keygen, p256::p256_ecdh_calc_shared_secret, p256::p256_sign, p256::p256_verify);
