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
use embassy_time::{Delay, Duration, Instant, Timer};
use firmware::bus::port::{Automatic, Line, Port};
use firmware::drive::{Surroundings, drive};
use firmware::dynamixel::bus::DynamixelBus;
use firmware::dynamixel::client::Client;
use firmware::fault::Feedback;
use firmware::library::Single;
use firmware::machine::{Machine, Show, Start, State};
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::stage::Library;

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
    let library = Single::new(clip.decoder, Some(rate));
    let mut puppet = Machine::new(&map, library, SHOW, Start::Power);
    let baud = map.buses().first().map_or(0, |bus| bus.baud);
    let uart = match uart::Uart::new(core.NVIC, baud) {
        Ok(uart) => uart,
        Err(error) => defmt::panic!("bus: {}", error),
    };
    let line = Line { slack_us: SLACK_US, ..Line::uart(baud) };
    let mut bus = DynamixelBus::<_, _, _>::new(Client::new(Port::new(uart, Automatic, Delay, line)));

    defmt::info!("{} frames at {} cHz on {} servos", clip.frames, rate, map.joints().len());
    let mut simulation = Simulation { map: &map, start: Instant::now(), state: State::Finding };
    let ticks = drive(&mut puppet, &mut bus, &mut simulation).await;
    let millis = simulation.start.elapsed().as_millis();
    match puppet.fault() {
        None => {
            defmt::info!("rests after {} ticks in {} ms", ticks, millis);
            exit::success()
        }
        Some(fault) => defmt::panic!("{}", fault),
    }
}

/// The linked-in clip, then home.
const SHOW: Show<'static> = Show {
    playlist: &[0],
    repeats: false,
    idle_clip: None,
    trigger_clip: None,
    after: firmware::machine::After::Home,
};

/// How late servos may answer. Those of QEMU live in another process on a machine that has other things to do; nothing
/// here waits that long unless one is missing.
const SLACK_US: u32 = 2_000_000;

/// A simulated board ends when the puppet rests. Its clock says nothing about deadlines: under QEMU it is the host's.
struct Simulation<'m> {
    map: &'m JointMap<MAX_SERVOS>,
    start: Instant,
    state: State,
}

impl<L: Library> Surroundings<L, MAX_SERVOS> for Simulation<'_> {
    async fn wait(&mut self, tick: u32) -> bool {
        Timer::at(self.start + Duration::from_micros(self.map.tick_micros(tick))).await;
        false
    }

    fn control(&mut self, puppet: &mut Machine<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        if puppet.state() != self.state {
            self.state = puppet.state();
            defmt::info!("{}", self.state);
        }
        !puppet.at_rest()
    }

    fn feed(&mut self) {}
}
