//! A wearable as a whole: sleeps by WFI, wakes by SysTick, decodes, and puts levels out, for ever.
//!
//! Nothing is left out of what its core does: cycles are those between two calls of `present`, asleep or not.
#![no_std]
#![no_main]

mod ends;
mod lend;
mod loaded;
#[cfg_attr(feature = "mclip", path = "store_mclip.rs")]
#[cfg_attr(not(feature = "mclip"), path = "store_qmd.rs")]
mod store;

use core::hint::black_box;
use core::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use ends::failed;
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::wearable::Wearable;
use loaded::{File, Number};

/// The joint map.
#[unsafe(no_mangle)]
static MAP: File = File::NONE;

/// Ticks a second.
#[unsafe(no_mangle)]
static OUTPUT_HZ: Number = Number::NONE;

/// The core's clock.
#[unsafe(no_mangle)]
static CLOCK_HZ: Number = Number::NONE;

/// Where peripherals take the levels from.
static LEVELS: [AtomicI32; MAX_SERVOS] = [const { AtomicI32::new(0) }; MAX_SERVOS];

/// Whether the time of a tick has come.
static DUE: AtomicBool = AtomicBool::new(false);

#[entry]
fn main() -> ! {
    let (Some(core), Ok(map)) = (cortex_m::Peripherals::take(), JointMap::<MAX_SERVOS>::parse(MAP.bytes()))
    else {
        failed()
    };
    let Ok((decoder, _)) = store::decoder() else { failed() };
    let output_hz = OUTPUT_HZ.get() as u16;
    let Ok(mut wearable) = Wearable::new(decoder, &map, output_hz) else { failed() };
    let mut syst = core.SYST;
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(CLOCK_HZ.get() as u32 / u32::from(output_hz) - 1);
    syst.clear_current();
    syst.enable_counter();
    syst.enable_interrupt();
    loop {
        sleep();
        match wearable.tick() {
            Ok(levels) => present(levels),
            Err(_) => failed(),
        }
    }
}

/// Until the next tick.
fn sleep() {
    loop {
        // With interrupts held back, one that comes before WFI still wakes it.
        cortex_m::interrupt::disable();
        if DUE.load(Ordering::Relaxed) {
            DUE.store(false, Ordering::Relaxed);
            // SAFETY: nothing here is shared but `DUE`.
            unsafe { cortex_m::interrupt::enable() };
            return;
        }
        cortex_m::asm::wfi();
        // SAFETY: as above. The interrupt is handled here.
        unsafe { cortex_m::interrupt::enable() };
    }
}

/// Puts the levels out.
#[inline(never)]
#[unsafe(no_mangle)]
fn present(levels: &[i32]) {
    for (output, &level) in LEVELS.iter().zip(levels) {
        output.store(level, Ordering::Relaxed);
    }
    // Something reads them.
    black_box(&LEVELS);
}

#[exception]
fn SysTick() {
    DUE.store(true, Ordering::Relaxed);
}
