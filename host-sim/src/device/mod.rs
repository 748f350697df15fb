//! A virtual device: the firmware's own machine, store, stream and link, on virtual servos, in real time.

mod hosts;

pub use hosts::{GUESTS, HELLO_MILLIS, HOSTS, Hosts, Key, Listener};

use crate::flash::Flash;
use anyhow::{Context, Result, anyhow, bail};
use decoder_core::mclip::Needs;
use decoder_core::{I16F16, Limits};
use firmware::clips::{Clips, DecoderMemory, Mailbox, Worker, decode};
use firmware::control_loop::{Surroundings, control_loop};
use firmware::device::{Device, Identity};
use firmware::fault::Feedback;
use firmware::link::message::DATA_BYTES;
use firmware::machine::{Machine, Show, Start};
use firmware::map::{BusKind, MAX_SERVOS};
use firmware::store::{Layout, Store};
use firmware::stream::{Live, Memory, PlayerMemory, Settings};
use puppet_file::Map;
use servo_wire::dynamixel::{DynamixelBus, DynamixelClient};
use servo_wire::port::{Automatic, LineConfig, Port};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::uart::{InProcessUart, ZeroDelay};
use virtual_servos::virtual_bus::VirtualBus;

/// Bytes of a sector of the virtual flash.
pub const SECTOR: usize = 4096;

/// Most channels of a clip.
const CHANNELS: usize = 256;

/// 16-bit words for entropy stages and windows of each decoder.
const WORDS: usize = 32_768;

/// Entry points that a decoder finds without looking through the clip.
const ENTRIES: usize = 4096;

/// Bytes of the buffer for streamed blocks: half a second and more of most clips.
const STREAM_BYTES: usize = 8192;

/// Bytes of a streamed clip's header.
const HEADER_BYTES: usize = 8192;

/// What a virtual device is.
#[derive(Clone, Debug)]
pub struct Config {
    /// What it is called, 32 bytes at most.
    pub name: String,
    /// The file that its flash is kept in; without, it forgets its clips.
    pub flash: Option<PathBuf>,
    /// Size of the flash in KiB.
    pub flash_kib: usize,
    /// The clip that plays while no other one does.
    pub idle_clip: Option<u16>,
    /// The clip that a trigger plays.
    pub trigger_clip: Option<u16>,
    /// How streams are played.
    pub stream: Settings,
    /// What hosts have to have the key of.
    pub key: Option<Key>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            name: "virtual".to_owned(),
            flash: None,
            flash_kib: 1024,
            idle_clip: None,
            trigger_clip: None,
            stream: Settings { ahead_millis: 200, lost_millis: 2000, limits: Limits::MAX },
            key: None,
        }
    }
}

/// Runs a device until `ended` says so.
///
/// # Errors
/// A sentence where the puppet has servos other than Dynamixel on one bus, or the flash's file cannot be used.
pub fn run_device(map: &Map, config: &Config, listener: Listener, ended: &dyn Fn() -> bool) -> Result<()> {
    if map.buses().len() != 1 || map.buses().iter().any(|bus| bus.kind != BusKind::Dynamixel) {
        bail!("the virtual servos are Dynamixel X on one bus, and this puppet has others");
    }
    let name = config.name.as_str().try_into();
    let name = name.map_err(|_| anyhow!("the name {:?} is longer than 32 bytes", config.name))?;

    let joints = map.joints().iter();
    let servos = joints.map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let mut servos = DynamixelServos::new(&DynamixelConfig {
        servos: servos.collect(),
        ..DynamixelConfig::with_ids(&[])
    })?;
    let power_on = Instant::now();
    let line =
        InProcessUart::new(|bytes: &[u8]| servos.receive(bytes, micros(power_on.elapsed()), &mut |_| ()));
    let baud = map.buses().first().map_or(0, |bus| bus.baud);
    let port = Port::new(line, Automatic, ZeroDelay, LineConfig::uart(baud));
    let mut bus = DynamixelBus::<_, _, _>::new(DynamixelClient::new(port));

    let live = live(config);
    let clips = Clips::new(&[], Some(store(config)?), live, [worker(live), worker(live)]);
    let show = Show { idle_clip: config.idle_clip, trigger_clip: config.trigger_clip, ..Show::default() };
    let mut machine = Machine::new(map, clips, show, Start::Power);
    let identity = Identity { name, clock_hz: 1_000_000, data_bytes: 512, flash_stalls: false };
    let mut surroundings = RealTime {
        map,
        device: Device::new(identity),
        hosts: Hosts::new(listener, config.key),
        ended,
        power_on,
        start: Instant::now(),
        woken: Instant::now(),
        busy: Duration::ZERO,
        late: false,
    };
    embassy_futures::block_on(control_loop(&mut machine, &mut bus, &mut surroundings));
    Ok(())
}

/// Memory of a device, which a board has for ever.
fn leak<T>(memory: T) -> &'static mut T {
    Box::leak(Box::new(memory))
}

/// The live stream.
fn live(config: &Config) -> &'static Live<'static> {
    let pose = || &mut leak([I16F16::ZERO; CHANNELS])[..];
    let poses = [pose(), pose(), pose(), pose()];
    let player = PlayerMemory { header: leak([0; HEADER_BYTES]), block: leak([0; DATA_BYTES]), poses };
    let memory = Memory { buffer: leak([0; STREAM_BYTES]), player };
    leak(Live::new(memory, config.stream))
}

/// A decoder.
fn worker(live: &'static Live<'static>) -> Worker<'static, 'static> {
    let mailbox: &'static Mailbox<'static> = leak(Mailbox::new());
    let memory = leak(DecoderMemory::<CHANNELS, { 4 * CHANNELS }, WORDS, ENTRIES>::new());
    let task = leak(Box::pin(decode(mailbox, memory, live)));
    Worker::new(task.as_mut(), mailbox, leak([I16F16::ZERO; CHANNELS]))
}

/// The clips in flash: the directory in the first two sectors, clips in the others.
fn store(config: &Config) -> Result<Store<Flash<SECTOR>>> {
    let sectors = (config.flash_kib * 1024 / SECTOR).max(3);
    let flash = match &config.flash {
        Some(path) => Flash::open(path, sectors)?,
        None => Flash::new(sectors),
    };
    let sector = SECTOR as u32;
    let end = u32::try_from(sectors * SECTOR).context("the flash is larger than 4 GiB")?;
    let layout = Layout { directory: [0, sector], clips: 2 * sector..end };
    let capacity = Needs { channels: CHANNELS, words: 4 * CHANNELS, halves: WORDS };
    Ok(Store::mount(flash, layout, capacity)?)
}

/// Ticks by the computer's clock, with hosts on hosts.
struct RealTime<'a> {
    map: &'a Map,
    device: Device,
    hosts: Hosts,
    ended: &'a dyn Fn() -> bool,
    power_on: Instant,
    /// When tick 0 was, or would have been had this computer never been busy with others.
    start: Instant,
    /// When the tick began.
    woken: Instant,
    busy: Duration,
    late: bool,
}

impl Surroundings<Clips<'_, '_, Flash<SECTOR>>, MAX_SERVOS> for RealTime<'_> {
    async fn wait(&mut self, tick: u32) -> bool {
        self.busy = self.woken.elapsed();
        let due = |tick| self.start + Duration::from_micros(self.map.tick_micros(tick));
        let (this, next) = (due(tick), due(tick.wrapping_add(1)));
        std::thread::sleep(this.saturating_duration_since(Instant::now()));
        self.woken = Instant::now();
        self.late = self.woken >= next;
        if self.late {
            self.start += self.woken - this;
        }
        // Hosts see it, but what an operating system does with its time is no fault of the puppet.
        false
    }

    fn control(
        &mut self,
        machine: &mut Machine<'_, Clips<'_, '_, Flash<SECTOR>>, MAX_SERVOS>,
        feedback: &Feedback<'_>,
    ) -> bool {
        let Self { device, hosts, .. } = self;
        let millis = micros(self.power_on.elapsed()) / 1000;
        let told = Feedback { late: self.late, ..*feedback };
        device.tick(machine, &told, millis as u32, micros(self.busy) as u32);
        hosts.serve(millis as u32, |session, bytes| device.serve(session, bytes, machine, feedback));
        !(self.ended)()
    }

    fn feed(&mut self) {}
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
