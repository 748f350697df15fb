//! Plays clips from flash, linked in and streamed, on buses of every kind, with a host on a line; on inputs that the compiler
//! knows nothing of.
//!
//! `tests/tests/panic_free.rs` links this for Cortex-M with overflow checks on and looks through its symbols. Inputs come
//! through volatile reads, or link-time optimisation would fold the player away and the check would prove nothing. The image
//! is never run.
#![no_std]
#![no_main]

mod devices;

use core::hint::black_box;
use core::panic::PanicInfo;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use decoder_core::{I16F16, Limits};
use devices::{Flash, Nothing, Pin, Uart, bytes, number};
use firmware::bus::BoardBuses;
use firmware::clips::{Clips, DecoderMemory, Mailbox, Worker, decode};
use firmware::control_loop::{Surroundings, control_loop};
use firmware::device::{Device, Identity};
use firmware::fault::Feedback;
use firmware::follow::Follow;
use firmware::library::Library;
use firmware::link::session::Session;
use firmware::machine::{After, Command, Machine, Show, Start};
use firmware::map::{BusKind, JointMap, MAX_SERVOS};
use firmware::store::{Layout, Store};
use firmware::stream::{Live, Memory, PlayerMemory, Settings};
use firmware::wearable::Wearable;
use servo_wire::bus::ServoBus;
use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
use servo_wire::feetech::{FeetechBus, Series};
use servo_wire::pca9685::{CHANNELS as OUTPUTS, OSCILLATOR_HZ, Pca9685Bus};
use servo_wire::port::{LineConfig, Port};
use servo_wire::protocol1::{Protocol1Bus, Protocol1Client};
use servo_wire::pwm::{Calibration, Channel, PwmBus};

/// Looks at what it is told. Otherwise all panics are the same to the linker, and it leaves one name for all.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    loop {
        black_box(info);
    }
}

const CHANNELS: usize = 64;

type Space = DecoderMemory<CHANNELS, { 4 * CHANNELS }, 2048, 32>;

type Puppet<'m, 't, 's> = Machine<'m, Clips<'t, 's, Flash>, MAX_SERVOS>;

#[unsafe(no_mangle)]
extern "C" fn entry() -> ! {
    loop {
        black_box(play());
        #[cfg(feature = "planted")]
        assert!(number() != 1, "planted");
    }
}

/// Polls a future to its end.
fn wait<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
    }
}

fn line() -> LineConfig {
    let uart = LineConfig::uart(number());
    LineConfig { return_delay_us: number(), turnaround_us: number(), echo: number() == 1, ..uart }
}

fn port() -> Port<Uart, Pin, Nothing> {
    Port::new(Uart, Pin, Nothing, line())
}

fn play() -> Option<u32> {
    let map = JointMap::<MAX_SERVOS>::parse(bytes()).ok()?;
    let (mut buffer, mut header, mut block) = ([0; 4096], [0; 1024], [0; 1024]);
    let mut poses = [[I16F16::ZERO; CHANNELS]; 4];
    let player = PlayerMemory {
        header: &mut header,
        block: &mut block,
        poses: poses.each_mut().map(|pose| &mut pose[..]),
    };
    let limits = Limits { channels: number() as u16, frames: number() };
    let settings = Settings { ahead_millis: number() as u16, lost_millis: number() as u16, limits };
    let live = Live::new(Memory { buffer: &mut buffer, player }, settings);
    let (mut first, mut second) = (Space::new(), Space::new());
    let (mut poses, mailboxes) = ([[I16F16::ZERO; CHANNELS]; 2], [Mailbox::new(), Mailbox::new()]);
    let [one, other] = poses.each_mut();
    let first = pin!(decode(&mailboxes[0], &mut first, &live));
    let second = pin!(decode(&mailboxes[1], &mut second, &live));
    let workers = [Worker::new(first, &mailboxes[0], one), Worker::new(second, &mailboxes[1], other)];
    let start = number();
    let layout = Layout { directory: [start, number()], clips: number()..number() };
    let store = Store::mount(Flash::new(), layout, Space::CAPACITY).ok();
    let linked = [bytes()];
    let clips = Clips::new(&linked, store, &live, workers);
    let playlist = [number() as u16, number() as u16];
    let show = Show {
        playlist: &playlist,
        repeats: number() == 1,
        idle_clip: (number() == 1).then_some(1),
        trigger_clip: (number() == 1).then_some(2),
        after: if number() == 1 { After::Hold } else { After::Home },
    };
    let cause = if number() == 1 { Start::Power } else { Start::ByItself };
    let mut machine = Machine::new(&map, clips, show, cause);
    let identity = Identity {
        name: "board".try_into().ok()?,
        clock_hz: number(),
        data_bytes: number() as u16,
        flash_stalls: number() == 1,
    };
    let mut board = Board { device: Device::new(identity), session: Session::new() };
    let ticks = match number() {
        0 => on_buses(
            &mut machine,
            &mut board,
            &map,
            DynamixelBus::<_, _, _>::new(DynamixelClient::new(port())),
        )?,
        1 => on_buses(
            &mut machine,
            &mut board,
            &map,
            Protocol1Bus::<_, _, _>::new(Protocol1Client::new(port())),
        )?,
        _ => {
            let series = if number() == 1 { Series::Sts } else { Series::Scs };
            let bus = FeetechBus::<_, _, _>::new(Protocol1Client::new(port()), series);
            on_buses(&mut machine, &mut board, &map, bus)?
        }
    };
    without_a_bus(&map);
    Some(ticks)
}

/// Outputs without a bus, and goals that somebody sends live.
fn without_a_bus(map: &JointMap<MAX_SERVOS>) {
    let follow = Follow::new(map, number() as u16);
    follow.feed(bytes());
    black_box((follow.tick(), follow.counters()));
    if let Ok(mut wearable) = Wearable::new(follow.frames(), map, number() as u16) {
        while number() == 1 {
            let _ = black_box(wearable.tick());
        }
    }
}

/// Plays on a serial bus, beside hobby servos.
fn on_buses<S: ServoBus>(
    machine: &mut Puppet<'_, '_, '_>,
    board: &mut Board,
    map: &JointMap<MAX_SERVOS>,
    serial: S,
) -> Option<u32> {
    let calibrations =
        [Calibration { min_us: number() as u16, max_us: number() as u16, trim_us: number() as i16 }; OUTPUTS];
    let pca9685 = Pca9685Bus::at(Nothing, number() as u8, Nothing, OSCILLATOR_HZ, calibrations).ok();
    let channel = || Channel::new(Pin, Calibration::WIDE);
    let pwm = Some(PwmBus::new([channel(), channel(), channel(), channel()], number() as u16));
    let mut bus = BoardBuses { serial: Some((BusKind::Dynamixel, serial)), pca9685, pwm }.of_map(map).ok()?;
    Some(wait(control_loop(machine, &mut bus, board)))
}

/// A board with a host on a line.
struct Board {
    device: Device,
    session: Session,
}

impl Surroundings<Clips<'_, '_, Flash>, MAX_SERVOS> for Board {
    async fn wait(&mut self, _: u32) -> bool {
        number() == 1
    }

    fn control(&mut self, machine: &mut Puppet<'_, '_, '_>, feedback: &Feedback<'_>) -> bool {
        self.device.tick(machine, feedback, number(), number());
        let mut line: &[u8] = bytes();
        self.device.serve(&mut self.session, &mut line, machine, feedback);
        black_box(self.session.outgoing());
        self.session.sent(number() as usize);
        let _ = black_box(machine.command(Command::Play { clip: number() as u16, repeats: number() == 1 }));
        if let Some(store) = machine.library().store() {
            black_box((store.status(), store.room(), store.get(number() as u16)));
        }
        if number() == 1 {
            let _ = machine.library().open(number() as u16).map(|clip| machine.library().close(clip));
        }
        number() == 1
    }

    fn feed(&mut self) {}
}
