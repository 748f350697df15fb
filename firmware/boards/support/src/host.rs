//! A show that a host can talk to: clips in flash and live streams besides the linked-in clip.

use crate::clip;
use crate::hobby::Hobby;
use crate::show::{BoardSurroundings, Puppet, SHOW, Wiring};
use core::pin::pin;
use decoder_core::{I16F16, Limits};
use embassy_futures::poll_once;
use embassy_time::{Delay, Duration, Instant};
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::pwm::SetDutyCycle;
use embedded_hal_async::i2c::I2c;
use embedded_io_async::{Read, Write};
use firmware::clips::{Clips, DecoderMemory, Mailbox, Worker, decode};
use firmware::control_loop::{Surroundings, control_loop};
use firmware::device::{Device, Identity};
use firmware::fault::Feedback;
use firmware::link::message::DATA_BYTES;
use firmware::link::session::Session;
use firmware::machine::Machine;
use firmware::map::MAX_SERVOS;
use firmware::store::{Layout, MappedFlash, Store};
use firmware::stream::{Live, Memory, PlayerMemory, Settings};
use servo_wire::dynamixel::bus::DynamixelBus;
use servo_wire::dynamixel::client::DynamixelClient;
use servo_wire::port::Port;

/// Most channels of a clip.
const CHANNELS: usize = 128;

/// 16-bit words for entropy stages and windows of each of the two decoders.
const WORDS: usize = 8192;

/// Bytes of the buffer for streamed blocks, and of a streamed clip's header.
const STREAM_BYTES: usize = 8192;
const HEADER_BYTES: usize = 8192;

/// How streams are played: a fifth of a second behind the host, and lost after two without a block.
const STREAM: Settings = Settings {
    ahead_millis: 200,
    lost_millis: 2000,
    limits: Limits { channels: CHANNELS as u16, frames: u32::MAX },
};

/// Bytes of the line that are kept between ticks.
const INPUT: usize = 2048;

/// Entry points that a decoder finds without looking through the clip. Of a longer clip the index has every second one, or fewer.
const ENTRIES: usize = 32;

type Decoder = DecoderMemory<CHANNELS, { 4 * CHANNELS }, WORDS, ENTRIES>;

/// What a board brings for its host.
pub struct Host<H, F> {
    /// The line; its reads and writes are buffered.
    pub line: H,
    /// Flash that is mapped into memory, and where clips are in it. Where there is none, uploads are refused.
    pub store: Option<(F, Layout)>,
    /// What the device says of itself.
    pub identity: Identity,
}

impl Puppet {
    /// As [`play`](Self::play), with a host on a line: for ever. Panics where the linked-in clip is damaged or the flash has no such
    /// layout; and when it is called again, since its memory is there once.
    pub async fn serve<U, D, T, W, H, F, I, P, const N: usize>(
        &mut self,
        wiring: Wiring<U, D, T, W>,
        host: Host<H, F>,
        hobby: Hobby<I, P, N>,
    ) where
        I: I2c,
        P: SetDutyCycle,
        U: Read + Write,
        D: OutputPin,
        T: InputPin,
        W: FnMut(),
        H: Read + Write,
        F: MappedFlash,
    {
        let map = &self.map;
        let Wiring { uart, direction, line, trigger, feed, start, simulated } = wiring;
        let Host { line: host, store, identity } = host;
        if let Err(error) = clip::check() {
            defmt::panic!("clip: {}", error);
        }
        let store = store.map(|(flash, layout)| match Store::mount(flash, layout, Decoder::CAPACITY) {
            Ok(store) => store,
            Err(error) => defmt::panic!("flash: {}", error),
        });
        let mut poses = [[I16F16::ZERO; CHANNELS]; 6];
        let [first_pose, second_pose, poses @ ..] = poses.each_mut().map(|pose| &mut pose[..]);
        let (buffer, header, block, first, second) = memory();
        let live = Live::new(Memory { buffer, player: PlayerMemory { header, block, poses } }, STREAM);
        let mailboxes = [Mailbox::new(), Mailbox::new()];
        let first = pin!(decode(&mailboxes[0], first, &live));
        let second = pin!(decode(&mailboxes[1], second, &live));
        let workers =
            [Worker::new(first, &mailboxes[0], first_pose), Worker::new(second, &mailboxes[1], second_pose)];
        let linked = [clip::CLIP];
        let clips = Clips::new(&linked, store, &live, workers);
        let mut machine = Machine::new(map, clips, SHOW, start);
        let serial =
            DynamixelBus::<_, _, _>::new(DynamixelClient::new(Port::new(uart, direction, Delay, line)));
        let mut bus = hobby.with(map, serial);
        defmt::info!("{} bytes of motion on {} servos", clip::CLIP.len(), map.joints().len());
        let mut served = Served {
            board: BoardSurroundings::new(map, trigger, feed, simulated),
            clock_hz: identity.clock_hz,
            device: Device::new(identity),
            session: Session::new(),
            line: host,
            input: heapless::Vec::new(),
            woken: Instant::now(),
            busy: Duration::MIN,
        };
        control_loop(&mut machine, &mut bus, &mut served).await;
    }
}

/// What is too large for a stack: buffer, header and block of the stream, and two decoders.
type Buffers =
    (&'static mut [u8], &'static mut [u8], &'static mut [u8], &'static mut Decoder, &'static mut Decoder);

fn memory() -> Buffers {
    let buffer = cortex_m::singleton!(: [u8; STREAM_BYTES] = [0; STREAM_BYTES]);
    let header = cortex_m::singleton!(: [u8; HEADER_BYTES] = [0; HEADER_BYTES]);
    let block = cortex_m::singleton!(: [u8; DATA_BYTES] = [0; DATA_BYTES]);
    let first = cortex_m::singleton!(: Decoder = Decoder::new());
    let second = cortex_m::singleton!(: Decoder = Decoder::new());
    match (buffer, header, block, first, second) {
        (Some(buffer), Some(header), Some(block), Some(first), Some(second)) => {
            (buffer, header, block, first, second)
        }
        _ => defmt::panic!("the puppet is served already"),
    }
}

/// A board with a host.
struct Served<'m, T, W, H> {
    board: BoardSurroundings<'m, T, W>,
    device: Device,
    clock_hz: u32,
    session: Session,
    line: H,
    /// What has come and was not looked at.
    input: heapless::Vec<u8, INPUT>,
    woken: Instant,
    /// How long the last tick took.
    busy: Duration,
}

impl<T, W, H: Read + Write> Served<'_, T, W, H> {
    /// Takes what has come, as far as there is room. What is on the line beyond that is lost in the driver, and asked for again.
    fn receive(&mut self) {
        let mut chunk = [0; 64];
        while self.input.capacity() - self.input.len() >= chunk.len() {
            match poll_once(self.line.read(&mut chunk)) {
                core::task::Poll::Ready(Ok(count)) if count > 0 => {
                    // There is room for it.
                    let _ = self.input.extend_from_slice(chunk.get(..count).unwrap_or_default());
                }
                // What noise has damaged fails its checksum.
                core::task::Poll::Ready(Err(_)) => {}
                _ => break,
            }
        }
    }

    fn send(&mut self) {
        while !self.session.outgoing().is_empty() {
            match poll_once(self.line.write(self.session.outgoing())) {
                core::task::Poll::Ready(Ok(count)) if count > 0 => self.session.sent(count),
                _ => break,
            }
        }
    }
}

impl<F, T, W, H> Surroundings<Clips<'_, '_, F>, MAX_SERVOS> for Served<'_, T, W, H>
where
    F: MappedFlash,
    T: InputPin,
    W: FnMut(),
    H: Read + Write,
{
    async fn wait(&mut self, tick: u32) -> bool {
        self.busy = self.woken.elapsed();
        let late = Surroundings::<Clips<'_, '_, F>, MAX_SERVOS>::wait(&mut self.board, tick).await;
        self.woken = Instant::now();
        late
    }

    fn control(
        &mut self,
        machine: &mut Machine<'_, Clips<'_, '_, F>, MAX_SERVOS>,
        feedback: &Feedback<'_>,
    ) -> bool {
        let millis = self.board.millis();
        let busy = self.busy.as_micros() * u64::from(self.clock_hz) / 1_000_000;
        self.device.tick(machine, feedback, millis, busy as u32);
        self.receive();
        let mut bytes = self.input.as_slice();
        self.device.serve(&mut self.session, &mut bytes, machine, feedback);
        let taken = self.input.len() - bytes.len();
        self.input.rotate_left(taken);
        self.input.truncate(self.input.len() - taken);
        self.send();
        self.board.control(machine, feedback)
    }

    fn feed(&mut self) {
        Surroundings::<Clips<'_, '_, F>, MAX_SERVOS>::feed(&mut self.board);
    }
}
