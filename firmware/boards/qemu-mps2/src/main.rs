//! Plays the linked-in clip on the servos of the linked-in map, once, and ends the simulation.
//!
//! The clip and the map are chosen when the image is built: see build.rs.
#![no_std]
#![no_main]

#[cfg_attr(mclip, path = "clip_mclip.rs")]
#[cfg_attr(not(mclip), path = "clip_qmd.rs")]
mod clip;
mod exit;
mod time;
mod uart;

use core::num::NonZeroU16;
use embassy_executor::Spawner;
use embassy_time::{Duration, Instant, Timer};
use firmware::drive::{buffer_len, drive};
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::player::{Player, Repeat};

static MAP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/map.postcard"));

/// Rate to play at instead of the clip's own, in hundredths of a hertz, if one was given.
const CENTIHERTZ: Option<NonZeroU16> = match u16::from_str_radix(env!("BUNRAKU_CENTIHERTZ"), 10) {
    Ok(rate) => NonZeroU16::new(rate),
    Err(_) => panic!("BUNRAKU_CENTIHERTZ must be 0 to 65535"),
};

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let Some(core) = cortex_m::Peripherals::take() else {
        defmt::panic!("the core's peripherals are in use");
    };
    time::start(core.SYST);

    let map = match JointMap::<MAX_SERVOS>::parse(MAP) {
        Ok(map) => map,
        Err(error) => defmt::panic!("map: {}", error),
    };
    let mut memory = clip::Memory::EMPTY;
    let clip = match clip::open(&mut memory) {
        Ok(clip) => clip,
        Err(error) => defmt::panic!("clip: {}", error),
    };
    let rate = CENTIHERTZ.map_or(clip.rate_centihertz, NonZeroU16::get);
    let mut player = match Player::new(clip.decoder, rate, &map, Repeat::Once) {
        Ok(player) => player,
        Err(error) => defmt::panic!("player: {}", error),
    };
    let mut bus = match uart::Uart::new(core.NVIC, map.baud()) {
        Ok(bus) => bus,
        Err(error) => defmt::panic!("bus: {}", error),
    };

    defmt::info!("{} frames at {} cHz on {} servos", clip.frames, rate, map.joints().len());
    let start = Instant::now();
    let due = |tick| start + Duration::from_micros(map.tick_micros(tick));
    let mut buffer = [0; buffer_len(MAX_SERVOS)];
    let played = drive(&mut player, &mut bus, &mut buffer, async |tick| Timer::at(due(tick)).await).await;
    match played {
        Ok(ticks) => {
            defmt::info!("played {} ticks in {} ms", ticks, start.elapsed().as_millis());
            exit::success()
        }
        Err(error) => defmt::panic!("playing: {}", error),
    }
}
