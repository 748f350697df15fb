//! Plays the linked-in clip on the servos of the linked-in map, once, and ends the simulation.
//!
//! The clip and the map are chosen when the image is built: see build.rs.
#![no_std]
#![no_main]

mod exit;
mod time;
mod uart;

use core::num::NonZeroU16;
use decoder_core::{I16F16, Limits, qmd};
use embassy_executor::Spawner;
use embassy_time::{Duration, Instant, Timer};
use firmware::drive::{buffer_len, drive};
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::player::{Player, Repeat};

/// Most channels of a clip.
const CHANNELS: usize = 256;

/// Longest look-up table that is converted in advance (index bits 8); a longer one is read in place.
const TABLE: usize = 256;

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.qmd"));
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
    let clip = match qmd::Clip::parse(CLIP, Limits { channels: CHANNELS as u16, frames: u32::MAX }) {
        Ok(clip) => clip,
        Err(error) => defmt::panic!("clip: {}", error),
    };
    let mut pose = [I16F16::ZERO; CHANNELS];
    let mut table = [0; TABLE];
    let lent = (clip.table_len() <= TABLE).then_some(&mut table[..]);
    let decoder = match clip.decoder(&mut pose, lent) {
        Ok(decoder) => decoder,
        Err(error) => defmt::panic!("decoder: {}", error),
    };
    let rate = CENTIHERTZ.map_or(clip.rate_centihertz(), NonZeroU16::get);
    let mut player = match Player::new(decoder, rate, &map, Repeat::Once) {
        Ok(player) => player,
        Err(error) => defmt::panic!("player: {}", error),
    };
    let mut bus = match uart::Uart::new(core.NVIC, map.baud()) {
        Ok(bus) => bus,
        Err(error) => defmt::panic!("bus: {}", error),
    };

    defmt::info!("{} frames at {} cHz on {} servos", clip.frames(), rate, map.joints().len());
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
