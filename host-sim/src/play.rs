//! Plays a clip on virtual servos and records what they are told: by the firmware library right here, or by the
//! same library on a board under QEMU or on the simulated core.

use crate::board;
use crate::clip::Clip;
use crate::files;
use crate::qemu;
use crate::qemu_log::Log;
use crate::rp2040js;
use crate::signals::Folder;
use anyhow::{Context, Result, anyhow, bail};
use firmware::bus::BoardBuses;
use firmware::control_loop::{Surroundings, control_loop};
use firmware::fault::Feedback;
use firmware::library::Library;
use firmware::machine::Machine as Puppet;
use firmware::map::{BusKind, MAX_SERVOS};
use puppet_file::Map;
use servo_wire::bus::ServoBus;
use servo_wire::dynamixel::bus::DynamixelBus;
use servo_wire::dynamixel::client::DynamixelClient;
use servo_wire::pca9685::OSCILLATOR_HZ;
use servo_wire::port::{Automatic, LineConfig, Port};
use servo_wire::pwm::PwmTiming;
use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::task::{Context as TaskContext, Poll, Waker};
use std::time::Duration;
use thumb_cycles::{Core, Image, Machine, Usage};
use virtual_servos::hobby::HobbyBoard;
use virtual_servos::uart::{InProcessUart, ZeroDelay};

mod notes;
mod performance;
mod recorder;
mod recording;

pub(crate) use notes::Notes;
pub use notes::{Note, NoteKind};
pub use performance::Performance;
pub(crate) use recorder::Recorder;
pub use recorder::has_servos_for;
pub use recording::{Recording, Taken, seconds};

/// Plays on this machine, as fast as it goes.
///
/// `centihertz` is the rate to play at, in hundredths of a hertz, or 0 for the clip's own.
///
/// # Errors
/// Where clip and map do not fit together, or a servo refuses a goal.
pub fn on_host(clip: &Clip<'_>, map: &Map, centihertz: u16) -> Result<Recording> {
    let performed = perform(&Performance::of(clip, centihertz), map)?;
    match performed.failed {
        Some(error) => Err(error),
        None => Ok(performed.recording),
    }
}

/// What playing on this machine came to.
#[derive(Debug)]
pub struct Performed {
    /// What the servos were told.
    pub recording: Recording,
    /// What changed, in order.
    pub notes: Vec<Note>,
    /// Why it did not come to its end.
    pub failed: Option<anyhow::Error>,
}

/// Plays on virtual servos here, as fast as it goes, from power on to rest.
///
/// # Errors
/// Where clips and map do not fit together, or the servos are none that are here.
pub fn perform(performance: &Performance<'_>, map: &Map) -> Result<Performed> {
    performance.with_machine(map, |mut puppet| {
        let mut watching = ToTheEnd(Notes::default());
        let recorder = Recorder::with_pins(puppet.map())?;
        let recorder = on_the_spot(&mut puppet, recorder, &mut watching)?;
        let (recording, sound) = recorder.end();
        let failed = puppet.fault().map(|fault| anyhow!("{fault}")).or(sound.err());
        Ok(Performed { recording, notes: watching.0.all, failed })
    })
}

/// The rate to play at.
fn rate(clip: &Clip<'_>, centihertz: u16) -> u16 {
    if centihertz > 0 { centihertz } else { clip.rate_centihertz() }
}

/// Drives a machine on virtual servos in no time.
pub(crate) fn on_the_spot<'m, L: Library, S: Surroundings<L, MAX_SERVOS>>(
    puppet: &mut Puppet<'m, L, MAX_SERVOS>,
    recorder: Recorder<'m>,
    surroundings: &mut S,
) -> Result<Recorder<'m>> {
    let recorder = RefCell::new(recorder);
    let (board, hear) = (HobbyBoard::default(), |bytes: &[u8]| recorder.borrow_mut().receive(bytes));
    let mut bus = virtual_bus(puppet.map(), &board, hear)?;
    let end_tick = || recorder.borrow_mut().end_tick(&board.pins());
    now(control_loop(puppet, &mut bus, &mut Noting { surroundings, end_tick }))?;
    drop(bus);
    Ok(recorder.into_inner())
}

/// The buses of a puppet in this program: Dynamixel X behind a line that `hear` answers, and hobby servos on a board's pins.
pub fn virtual_bus<F: FnMut(&[u8]) -> Vec<u8>>(
    map: &Map,
    board: &HobbyBoard,
    hear: F,
) -> Result<impl ServoBus + use<F>> {
    let of = |kind: BusKind| map.buses().iter().find(|bus| bus.kind == kind);
    let baud = of(BusKind::Dynamixel).map_or(1, |bus| bus.baud);
    let port = Port::new(InProcessUart::new(hear), Automatic, ZeroDelay, LineConfig::uart(baud));
    let serial = DynamixelBus::<_, _, _>::new(DynamixelClient::new(port));
    let buses = BoardBuses {
        serial: Some((BusKind::Dynamixel, serial)),
        pca9685: Some(board.pca9685(map.oscillator_hz().unwrap_or(OSCILLATOR_HZ))?),
        pwm: of(BusKind::Pwm).map(|spec| pwm_timing(spec.baud)).transpose()?.map(|timing| board.pwm(timing)),
    };
    Ok(buses.of_map(map)?)
}

/// The timing of pins that give so many pulses a second.
pub(crate) fn pwm_timing(hz: u32) -> Result<PwmTiming> {
    PwmTiming::of(hz).with_context(|| format!("PWM cannot give {hz} pulses a second, expected 40 to 400"))
}

/// Surroundings, and somebody who looks at the end of each tick.
struct Noting<'s, S, F> {
    surroundings: &'s mut S,
    end_tick: F,
}

impl<L: Library, S: Surroundings<L, N>, F: FnMut(), const N: usize> Surroundings<L, N> for Noting<'_, S, F> {
    async fn wait(&mut self, tick: u32) -> bool {
        self.surroundings.wait(tick).await
    }

    fn control(&mut self, puppet: &mut Puppet<'_, L, N>, feedback: &Feedback<'_>) -> bool {
        self.surroundings.control(puppet, feedback)
    }

    fn feed(&mut self) {
        (self.end_tick)();
        self.surroundings.feed();
    }
}

/// Until the puppet rests, as fast as it goes.
struct ToTheEnd(Notes);

impl<L: Library, const N: usize> Surroundings<L, N> for ToTheEnd {
    async fn wait(&mut self, _: u32) -> bool {
        false
    }

    fn control(&mut self, puppet: &mut Puppet<'_, L, N>, _: &Feedback<'_>) -> bool {
        let tick = self.0.count(puppet);
        self.0.look(tick, puppet);
        !puppet.at_rest()
    }

    fn feed(&mut self) {}
}

/// Builds the image of the board `qemu-mps2` with this clip and map, and plays it under QEMU.
///
/// `bytes` are those of `clip`. `log` gets the lines that the board logs.
///
/// # Errors
/// As [`on_host`], where the image cannot be built, and where the board does not come to the end of the clip.
pub fn on_qemu(
    clip: &Clip<'_>,
    bytes: &[u8],
    map: &Map,
    centihertz: u16,
    log: &mut dyn FnMut(&str),
) -> Result<Recording> {
    let folder = Folder::new()?;
    let path = folder.path().join("bunraku-board");
    let elf = board::QEMU_MPS2.build(bytes, map, centihertz)?;
    files::write(&path, |file| Ok(file.write_all(&elf)?))?;
    let mut recorder = Recorder::new(map)?;
    let image = qemu::Image { path: &path, machine: board::QEMU_MACHINE, arguments: &[] };
    let mut device = |bytes: &[u8]| recorder.receive(bytes);
    qemu::run_image(&image, Some(&mut device), limit(clip.frames(), rate(clip, centihertz)), log)?;
    recorder.finish()
}

/// As [`on_qemu`], on the simulated Cortex-M4, which also says how its cycles were spent.
///
/// # Errors
/// As [`on_qemu`], and where the image does what the simulator does not know.
pub fn on_sim(
    clip: &Clip<'_>,
    bytes: &[u8],
    map: &Map,
    centihertz: u16,
    log: &mut dyn FnMut(&str),
) -> Result<(Recording, Usage)> {
    let elf = board::QEMU_MPS2.build(bytes, map, centihertz)?;
    let mut lines = Log::new(&elf)?;
    let image = Image::parse(&elf)?;
    let mut machine = Machine::new(Core::M4, &thumb_cycles::Board::mps2(), &image)?;
    let mut recorder = Recorder::new(map)?;
    let mut garbled = Ok(());
    let ended = machine.run_to_exit(
        &mut |bytes| recorder.receive(bytes),
        &mut |bytes| {
            if garbled.is_ok() {
                garbled = lines.take(bytes, log);
            }
        },
        limit(clip.frames(), rate(clip, centihertz)).as_secs() * u64::from(board::QEMU_CLOCK_HZ),
    );
    garbled?;
    match ended.map_err(|fault| anyhow!("{fault}"))? {
        Some(0) => Ok((recorder.finish()?, machine.usage())),
        Some(code) => bail!("the image on the simulated board ended with exit code {code}"),
        None => bail!("the image on the simulated board did not come to an end"),
    }
}

/// As [`on_qemu`], on the board `rp2040`, a Raspberry Pi Pico, in the emulator rp2040js.
///
/// # Errors
/// As [`on_qemu`]; where the emulator is missing, where its bus is driven from both ends, and where the board logs an error.
pub fn on_rp2040(
    clip: &Clip<'_>,
    bytes: &[u8],
    map: &Map,
    centihertz: u16,
    log: &mut dyn FnMut(&str),
) -> Result<(Recording, rp2040js::Figures)> {
    let elf = board::RP2040.build(bytes, map, centihertz)?;
    let recorder = RefCell::new(Recorder::with_pins(map)?);
    let limit = limit(clip.frames(), rate(clip, centihertz));
    let world = rp2040js::World {
        servos: &mut |bytes| recorder.borrow_mut().receive(bytes),
        pins: &mut |pins| recorder.borrow_mut().end_tick(pins),
        host: None,
        hang: None,
    };
    let figures = rp2040js::run(&elf, &rp2040js::package(), world, limit, log)?;
    Ok((recorder.into_inner().finish()?, figures))
}

/// How long QEMU may take, or simulated time be. A simulated second took half a second where this was measured; the
/// limit ends an image that hangs, and no busy machine.
fn limit(frames: u32, centihertz: u16) -> Duration {
    let seconds = u64::from(frames) * 100 / u64::from(centihertz.max(1));
    Duration::from_secs(600 + 30 * seconds)
}

/// Runs a future that never has to wait.
fn now<T>(future: impl Future<Output = T>) -> Result<T> {
    match pin!(future).poll(&mut TaskContext::from_waker(Waker::noop())) {
        Poll::Ready(result) => Ok(result),
        Poll::Pending => Err(anyhow!("a virtual servo made the player wait")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use encoder::qmd::{Method, Parameters, decode, encode};
    use firmware::clock::Speed;
    use puppet_file::Puppet;
    use std::path::Path;

    fn sample() -> (Vec<u8>, Map, mocap::Clip) {
        let clip = mocap::sample::clip();
        let puppet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../puppets/sample.toml");
        let map = Puppet::read(&puppet).unwrap().map(&clip.skeleton).unwrap();
        (encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).unwrap(), map, clip)
    }

    #[test]
    fn every_servo_follows_its_channel() {
        let (bytes, _, clip) = sample();
        let puppet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../puppets/sample.toml");
        let text = format!("interpolation = 'linear'\n{}", std::fs::read_to_string(&puppet).unwrap());
        let map = Puppet::parse(&puppet, text).unwrap().map(&clip.skeleton).unwrap();
        let recording = on_host(&Clip::parse(Path::new("clip.qmd"), &bytes).unwrap(), &map, 0).unwrap();
        let motion = decode(&bytes).unwrap();
        // 480 frames at 60 Hz last 479/60 s: 399.17 ticks of 50 Hz, the last of them at the last frame.
        let ticks = 401;
        let far = |start: u32| {
            let goals = recording.goals.iter().enumerate().skip(12 * start as usize).take(12 * ticks);
            goals.fold(0f64, |far, (index, taken)| {
                let joint = map.joints()[index % 12];
                assert_eq!((joint.id, taken.time_us), (taken.id, (index as u64 / 12) * 20_000));
                let time_us = taken.time_us - u64::from(start) * 20_000;
                let position = (time_us as f64 * 60e-6).min(479.0);
                let value = |frame: usize| motion.frame(frame.min(479))[usize::from(joint.channel)];
                let (before, part) = (position as usize, position.fract());
                let angle = value(before) * (1.0 - part) + value(before + 1) * part;
                let goal = f64::from(joint.zero) + angle * joint.scale.to_num::<f64>();
                far.max((f64::from(taken.position) - goal).abs())
            })
        };
        // Before it plays it finds its servos, turns them on, and eases to the first pose for two seconds.
        let (start, off) =
            (100..200).map(|start| (start, far(start))).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(off < 0.53, "{off} goal units from the clip, which begins at tick {start}");
        assert!(
            recording.ticks >= start + 401 + 98,
            "it goes home, which takes two seconds: {}",
            recording.ticks - start
        );
        let home = map.joints().iter().map(|joint| joint.home);
        assert!(recording.goals.iter().rev().take(12).rev().map(|taken| taken.position).eq(home));
    }

    #[test]
    fn another_rate_takes_another_time() {
        let (bytes, map, _) = sample();
        let clip = Clip::parse(Path::new("clip.qmd"), &bytes).unwrap();
        let ticks = |rate| on_host(&clip, &map, rate).unwrap().ticks;
        // The way to the first pose and home is the same, up to the tick in which all servos rest.
        assert!((ticks(0) - ticks(12_000)).abs_diff(200) <= 2);
    }

    /// Ticks of the whole, and where each clip began and none played any more.
    fn ticks_of(performance: &Performance<'_>, map: &Map) -> (u32, Vec<(String, u32)>) {
        let performed = perform(performance, map).unwrap();
        assert!(performed.failed.is_none());
        let clips = performed.notes.iter().filter(|note| note.what == NoteKind::Clip);
        (performed.recording.ticks, clips.map(|note| (note.text.clone(), note.tick)).collect())
    }

    /// 480 frames at 60 Hz are 400 ticks of 50 Hz; a fade is half a second, so 25 ticks, in which both clips play.
    #[test]
    fn clips_are_repeated_begun_later_and_played_at_another_speed() {
        let (bytes, map, _) = sample();
        let clip = Clip::parse(Path::new("clip.qmd"), &bytes).unwrap();
        let once = || Performance::of(&clip, 0);
        let (ticks, clips) = ticks_of(&once(), &map);
        let played = |clips: &[(String, u32)]| clips[1].1 - clips[0].1;
        assert_eq!(clips.iter().map(|(clip, _)| clip.as_str()).collect::<Vec<_>>(), ["0", ""]);
        let fade = map.settings().fade_ticks();
        for times in [2, 3] {
            let (longer, clips) = ticks_of(&Performance { times, ..once() }, &map);
            // The clip fades into itself, so that its number does not change.
            assert_eq!(clips.len(), 2, "{clips:?}");
            let more = (times - 1) * (400 - fade);
            assert!((longer - ticks).abs_diff(more) <= 3 * times, "{longer} ticks, {ticks} once");
        }
        let (_, later) = ticks_of(&Performance { start: 240, ..once() }, &map);
        assert!((played(&clips) - played(&later)).abs_diff(200) <= 2, "{later:?}");
        let (_, slow) = ticks_of(&Performance { speed: Speed::new(128), ..once() }, &map);
        // It takes 250 ms to come to that speed.
        assert!((played(&slow) - played(&clips)).abs_diff(400) <= 20, "{slow:?}");
        let named = |name: &str| (name.to_owned(), &clip);
        let two = Performance { clips: vec![named("one"), named("two")], ..once() };
        let (_, clips) = ticks_of(&two, &map);
        assert_eq!(clips.iter().map(|(clip, _)| clip.as_str()).collect::<Vec<_>>(), ["0", "1", ""]);
    }

    #[test]
    fn a_cut_bus_is_noticed() {
        let (_, map, _) = sample();
        let mut recorder = Recorder::new(&map).unwrap();
        assert!(recorder.receive(&[0xff, 0xff, 0xfd, 0x00, 0xfe]).is_empty());
        let error = recorder.finish().unwrap_err();
        assert!(error.to_string().contains("cut"), "{error}");
    }
}
