//! Plays the linked-in show on the servos of the linked-in map, tells what changes at which tick, and ends the simulation.
//!
//! UART, time and ends are those of the board `qemu-mps2`.
#![no_std]
#![no_main]

mod clips;
#[path = "../../qemu-mps2/src/exit.rs"]
mod exit;
#[path = "../../qemu-mps2/src/time.rs"]
mod time;
#[path = "../../qemu-mps2/src/uart.rs"]
mod uart;

use core::pin::pin;
use embassy_executor::Spawner;
use embassy_time::{Delay, Duration, Instant, Timer};
use firmware::clips::{Mailbox, WithLive, Worker, decode};
#[allow(unused_imports, reason = "not every show sets a speed")]
use firmware::clock::Speed;
use firmware::control_loop::{Surroundings, control_loop};
use firmware::decoder_list::DecoderList;
use firmware::fault::{Fault, Feedback};
use firmware::library::Library;
#[allow(unused_imports, reason = "not every show has commands")]
use firmware::machine::{After, Command, Machine, Show, Start, State};
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::script::{Order, Script};
use firmware::sender::{STREAM, Sender, StreamMemory};
use firmware::stream::{Counters, Live, Made};
use servo_wire::dynamixel::bus::DynamixelBus;
use servo_wire::dynamixel::client::DynamixelClient;
use servo_wire::port::{Automatic, LineConfig, Port};

static MAP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/map.postcard"));

include!(concat!(env!("OUT_DIR"), "/show.rs"));

/// How late servos may answer.
const SLACK_US: u32 = match u32::from_str_radix(env!("BUNRAKU_SLACK_US"), 10) {
    Ok(slack) => slack,
    Err(_) => panic!("BUNRAKU_SLACK_US must be a number of microseconds"),
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
    let mut memories = [const { clips::Memory::EMPTY }; clips::COUNT];
    let mut decoders = match clips::open(&mut memories) {
        Ok(decoders) => decoders,
        Err(error) => defmt::panic!("clip: {}", error),
    };
    let library = DecoderList::<_, { clips::COUNT }>::of(decoders.iter_mut().map(clips::Decoder::frames));
    let mut memory = StreamMemory::new();
    let (memory, decoder, pose) = memory.lend();
    let (live, mailbox) = (Live::new(memory, STREAM), Mailbox::new());
    let task = pin!(decode(&mailbox, decoder, &live));
    let library = WithLive::new(library, Worker::new(task, &mailbox, pose));
    let mut puppet = Machine::new(&map, library, SHOW, Start::Power);
    let baud = map.buses().first().map_or(0, |bus| bus.baud);
    let uart = match uart::Uart::new(core.NVIC, baud) {
        Ok(uart) => uart,
        Err(error) => defmt::panic!("bus: {}", error),
    };
    let line = LineConfig { slack_us: SLACK_US, ..LineConfig::uart(baud) };
    let mut bus = DynamixelBus::<_, _, _>::new(DynamixelClient::new(Port::new(uart, Automatic, Delay, line)));
    let mut surroundings = ShowSurroundings {
        map: &map,
        start: Instant::now(),
        script: Script::new(&ORDERS, Sender::new(&clips::FILES, &live)),
        state: None,
        fault: None,
        clip: None,
        made: None,
    };
    control_loop(&mut puppet, &mut bus, &mut surroundings).await;
    exit::success()
}

/// The show, and what was told last. A simulated board's clock says nothing about deadlines: under QEMU it is the host's.
struct ShowSurroundings<'m, 'l> {
    map: &'m JointMap<MAX_SERVOS>,
    start: Instant,
    script: Script<'m, 'l>,
    state: Option<State>,
    fault: Option<Fault>,
    clip: Option<u16>,
    made: Option<Made>,
}

impl<L: Library> Surroundings<L, MAX_SERVOS> for ShowSurroundings<'_, '_> {
    async fn wait(&mut self, tick: u32) -> bool {
        Timer::at(self.start + Duration::from_micros(self.map.tick_micros(tick))).await;
        false
    }

    fn control(&mut self, puppet: &mut Machine<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        let Self { script, state, fault, clip, made, .. } = self;
        // Refusals come with the tick that has just begun, which the script counts before it gives commands.
        let next = script.tick().map_or(0, |tick| tick.saturating_add(1));
        let goes_on = script.control(puppet, |command, error| {
            defmt::info!("tick {} refused {}: {}", next, command, error);
        });
        let tick = script.tick().unwrap_or(0);
        if state.replace(puppet.state()) != Some(puppet.state()) {
            defmt::info!("tick {} state {}", tick, puppet.state());
        }
        if core::mem::replace(fault, puppet.fault()) != puppet.fault() {
            match puppet.fault() {
                Some(fault) => defmt::info!("tick {} fault {}", tick, fault),
                None => defmt::info!("tick {} fault ", tick),
            }
        }
        let plays = puppet.mixer().position().map(|(clip, ..)| clip);
        if core::mem::replace(clip, plays) != plays {
            match plays {
                Some(clip) => defmt::info!("tick {} clip {}", tick, clip),
                None => defmt::info!("tick {} clip ", tick),
            }
        }
        let now = script.sender().made();
        if core::mem::replace(made, now) != now {
            match now {
                Some(made) => defmt::info!("tick {} stream {}", tick, made),
                None => {
                    let Counters { played, concealed, eased, lost, .. } = script.sender().counters();
                    defmt::info!("tick {} stream ", tick);
                    defmt::info!("tick {} streamed {} {} {} {}", tick, played, concealed, eased, lost);
                }
            }
        }
        goes_on
    }

    fn feed(&mut self) {}
}
