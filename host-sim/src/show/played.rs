//! Runs a show to its end.

use super::file::Program;
use super::images;
use crate::board;
use crate::files;
use crate::play::{Note, NoteKind, Notes, Recorder, Recording, on_the_spot};
use crate::qemu;
use crate::qemu_log::Log;
use crate::signals::Folder;
use anyhow::{Result, bail};
use firmware::clips::{Mailbox, WithLive, Worker, decode};
use firmware::control_loop::Surroundings;
use firmware::decoder_list::DecoderList;
use firmware::fault::Feedback;
use firmware::library::Library;
use firmware::machine::{Machine as Puppet, Start};
use firmware::map::MAX_SERVOS;
use firmware::script::Script;
use firmware::sender::{STREAM, Sender, StreamMemory};
use firmware::stream::{Counters, Live, Made};
use puppet_file::Map;
use serde::Serialize;
use std::pin::pin;
use std::time::Duration;
use thumb_cycles::{Board, Core, Image, Machine, Stop};

/// Microseconds that servos on the simulated wire may be late.
const SLACK_US: u32 = 300;

/// The same under QEMU, whose servos live in another process; nothing waits that long unless one is missing.
const QEMU_SLACK_US: u32 = 2_000_000;

/// What a tick cost on the simulated board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Cycles that the core was awake.
    pub awake: u64,
    /// Microseconds from the first byte of the goals to the last byte of the answers.
    pub bus_us: f64,
    /// Microseconds that were left before the next tick's goals, at least.
    pub left_us: f64,
}

/// A show that has come to its end.
#[derive(Clone, Debug)]
pub struct PlayedShow {
    /// What the servos were told, and where they were.
    pub recording: Recording,
    /// What changed, in order.
    pub notes: Vec<Note>,
    /// What each tick cost, on the simulated board.
    pub costs: Vec<Cost>,
}

impl PlayedShow {
    /// The state in the end.
    pub fn ends(&self) -> &str {
        self.last(NoteKind::State)
    }

    /// The fault that is latched in the end, if one is.
    pub fn fault(&self) -> Option<&str> {
        Some(self.last(NoteKind::Fault)).filter(|text| !text.is_empty())
    }

    fn last(&self, what: NoteKind) -> &str {
        self.notes.iter().rev().find(|note| note.what == what).map_or("", |note| &note.text)
    }
}

/// Runs it in this program, in no time.
///
/// # Errors
/// Where clips do not fit the puppet.
pub fn on_host(program: &Program) -> Result<PlayedShow> {
    let clips = program.parsed()?;
    let mut memories: Vec<_> = clips.iter().map(|clip| clip.lend()).collect();
    let decoders: Result<Vec<_>> =
        clips.iter().zip(&mut memories).map(|(clip, memory)| clip.decoder(memory)).collect();
    let mut decoders = decoders?;
    let library =
        DecoderList::<_, { super::file::MOST_CLIPS }>::of(decoders.iter_mut().map(|frames| &mut **frames));
    let mut memory = Box::new(StreamMemory::new());
    let (memory, decoder, pose) = memory.lend();
    let (live, mailbox) = (Live::new(memory, STREAM), Mailbox::new());
    let task = pin!(decode(&mailbox, decoder, &live));
    let library = WithLive::new(library, Worker::new(task, &mailbox, pose));
    let bytes: Vec<&[u8]> = program.clips.iter().map(|(.., bytes)| bytes.as_slice()).collect();
    let mut puppet = Puppet::new(&program.map, library, program.show(), Start::Power);
    let mut surroundings = ShowSurroundings {
        script: Script::new(&program.orders, Sender::new(&bytes, &live)),
        notes: Notes::default(),
        made: None,
        most: most_ticks(program)?,
    };
    let recorder = on_the_spot(&mut puppet, recorder(program)?, &mut surroundings)?;
    Ok(PlayedShow { recording: recorder.finish()?, notes: surroundings.notes.all, costs: Vec::new() })
}

/// The servos, and what will happen to them.
fn recorder(program: &Program) -> Result<Recorder<'_>> {
    let mut recorder = Recorder::new(&program.map)?;
    for (tick, disturbance) in &program.disturbances {
        recorder.schedule(*tick, *disturbance)?;
    }
    Ok(recorder)
}

/// Ticks after which a show has no end: those of its clips and events, and a minute.
fn most_ticks(program: &Program) -> Result<u32> {
    let seconds = |clip: &crate::clip::Clip<'_>| {
        f64::from(clip.frames()) * 100.0 / f64::from(clip.rate_centihertz().max(1))
    };
    let clips: f64 = program.parsed()?.iter().map(seconds).sum();
    let last = program.events.last().map_or(0.0, |(at, _)| *at);
    Ok(((4.0 * clips + last + 60.0) * f64::from(program.map.tick_hz())) as u32)
}

struct ShowSurroundings<'s, 'l> {
    script: Script<'s, 'l>,
    notes: Notes,
    made: Option<Made>,
    most: u32,
}

impl<L: Library> Surroundings<L, MAX_SERVOS> for ShowSurroundings<'_, '_> {
    async fn wait(&mut self, _: u32) -> bool {
        false
    }

    fn control(&mut self, puppet: &mut Puppet<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        let Self { script, notes, made, most } = self;
        let mut refused = Vec::new();
        let goes_on =
            script.control(puppet, |command, error| refused.push(format!("{command:?}: {error:?}")));
        let tick = script.tick().unwrap_or(0);
        refused.into_iter().for_each(|text| notes.add(tick, NoteKind::Refused, text));
        notes.look(tick, puppet);
        let now = script.sender().made();
        if std::mem::replace(made, now) != now {
            notes.add(tick, NoteKind::Stream, now.map_or(String::new(), |made| format!("{made:?}")));
            if now.is_none() {
                let Counters { played, concealed, eased, lost, .. } = script.sender().counters();
                notes.add(tick, NoteKind::Streamed, format!("{played} {concealed} {eased} {lost}"));
            }
        }
        goes_on && tick < *most
    }

    fn feed(&mut self) {}
}

/// Runs it on the simulated Cortex-M4, which also counts what each tick costs.
///
/// # Errors
/// As [`on_host`], and where the image cannot be built, does what the simulator does not know, or does not end.
pub fn on_sim(program: &Program, log: &mut dyn FnMut(&str)) -> Result<PlayedShow> {
    simulate(&image(program)?, program, recorder(program)?, &mut |_, _, packet| packet.to_vec(), log)
}

/// The image of a show for [`on_sim_wire`].
///
/// # Errors
/// Where it cannot be built.
pub fn image(program: &Program) -> Result<Vec<u8>> {
    images::build(program, SLACK_US)
}

/// What a wire does to packets: it is given the number of each packet of either direction, whether a servo sent it, and the
/// packet, and gives what gets through.
pub type Tamper<'t> = dyn FnMut(usize, bool, &[u8]) -> Vec<u8> + 't;

/// As [`on_sim`], with an image that is there and a wire that does what `wire` says.
///
/// # Errors
/// As [`on_sim`].
pub fn on_sim_wire(
    elf: &[u8],
    program: &Program,
    wire: &mut Tamper<'_>,
    log: &mut dyn FnMut(&str),
) -> Result<PlayedShow> {
    let mut recorder = recorder(program)?;
    recorder.bear_all();
    simulate(elf, program, recorder, wire, log)
}

fn simulate(
    elf: &[u8],
    program: &Program,
    mut recorder: Recorder<'_>,
    wire: &mut Tamper<'_>,
    log: &mut dyn FnMut(&str),
) -> Result<PlayedShow> {
    let mut lines = Log::new(elf)?;
    let parsed = Image::parse(elf)?;
    let mut machine = Machine::new(Core::M4, &Board::mps2(), &parsed)?;
    let (mut sent, mut packets) = (Packets::default(), 0);
    let mut notes = Vec::new();
    let mut meter = Meter::new(&program.map);
    let limit =
        u64::from(most_ticks(program)?) * u64::from(board::QEMU_CLOCK_HZ) / u64::from(program.map.tick_hz());
    loop {
        let stop = machine.run_until(meter.answered_at().unwrap_or(limit))?;
        let usage = machine.usage();
        let now = Moment { cycle: usage.cycles, awake: usage.cycles - usage.asleep };
        if !machine.semihosting.console.is_empty() {
            let bytes = std::mem::take(&mut machine.semihosting.console);
            lines.take(&bytes, &mut |line| read(line, &mut notes, log))?;
        }
        match stop {
            Stop::Exit(0) => break,
            Stop::Exit(code) => bail!("the image on the simulated board ended with exit code {code}"),
            Stop::Limit if meter.answered(now) => {}
            Stop::Limit => bail!("the image on the simulated board did not come to an end"),
            Stop::Sent { peripheral, byte } => {
                meter.byte(now, sent.is_empty());
                let Some(packet) = sent.take(byte) else { continue };
                let mut through = |from_servo, packet: &[u8]| {
                    packets += 1;
                    wire(packets - 1, from_servo, packet)
                };
                let answers = Packets::of(&recorder.receive_packet(&through(false, &packet)));
                let answers: Vec<u8> = answers.iter().flat_map(|packet| through(true, packet)).collect();
                meter.packet(now, answers.len(), recorder.ticks());
                machine.deliver(peripheral, &answers);
            }
            Stop::Breakpoint(_) | Stop::Returned | Stop::ItmWrite { .. } => {}
        }
    }
    Ok(PlayedShow { recording: recorder.finish()?, notes, costs: meter.costs })
}

/// Runs it under QEMU.
///
/// # Errors
/// As [`on_sim`].
pub fn on_qemu(program: &Program, log: &mut dyn FnMut(&str)) -> Result<PlayedShow> {
    let elf = images::build(program, QEMU_SLACK_US)?;
    let folder = Folder::new()?;
    let path = folder.path().join("bunraku-show");
    files::write(&path, |file| Ok(file.write_all(&elf)?))?;
    let mut recorder = recorder(program)?;
    let mut notes = Vec::new();
    let to_run = qemu::Image { path: &path, machine: board::QEMU_MACHINE, arguments: &[] };
    let limit =
        Duration::from_secs(120 + 10 * u64::from(most_ticks(program)? / u32::from(program.map.tick_hz())));
    let mut device = |bytes: &[u8]| recorder.receive(bytes);
    qemu::run_image(&to_run, Some(&mut device), limit, &mut |line| read(line, &mut notes, log))?;
    Ok(PlayedShow { recording: recorder.finish()?, notes, costs: Vec::new() })
}

/// A line of the board's log: `info: tick 12 state Playing` and the like; others are passed on.
fn read(line: &str, notes: &mut Vec<Note>, log: &mut dyn FnMut(&str)) {
    let parsed = || {
        let mut words = line.strip_prefix("info: tick ")?.splitn(3, ' ');
        let tick = words.next()?.parse().ok()?;
        let what = match words.next()? {
            "state" => NoteKind::State,
            "fault" => NoteKind::Fault,
            "clip" => NoteKind::Clip,
            "refused" => NoteKind::Refused,
            "stream" => NoteKind::Stream,
            "streamed" => NoteKind::Streamed,
            _ => return None,
        };
        Some(Note { tick, what, text: words.next().unwrap_or_default().trim().to_owned() })
    };
    match parsed() {
        Some(note) => notes.push(note),
        None => log(line),
    }
}

/// Packets of protocol 2.0 out of bytes of a wire on which nothing is lost.
#[derive(Default)]
struct Packets(Vec<u8>);

impl Packets {
    const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The packet that is whole with this byte.
    fn take(&mut self, byte: u8) -> Option<Vec<u8>> {
        self.0.push(byte);
        let &[low, high] = self.0.get(5..7)? else { return None };
        let whole = self.0.len() >= 7 + usize::from(u16::from_le_bytes([low, high]));
        whole.then(|| std::mem::take(&mut self.0))
    }

    /// All packets; a joint answer in which a servo is missing ends early.
    fn of(bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut packets = Self::default();
        let mut all: Vec<Vec<u8>> = bytes.iter().filter_map(|&byte| packets.take(byte)).collect();
        all.extend(Some(packets.0).filter(|rest| !rest.is_empty()));
        all
    }
}

/// What ticks cost, from what goes over the simulated wire.
struct Meter {
    byte_cycles: u64,
    costs: Vec<Cost>,
    ticks: u32,
    /// The packet that is being sent: when it began.
    packet: Moment,
    /// The tick that is on: when its goals began, and its last byte so far.
    tick: Option<(Moment, Moment)>,
    /// When the last tick's goals were out.
    goals: Moment,
    /// When the answers that are on their way will be in.
    answers: Option<u64>,
}

/// A cycle, and how many until then were not slept.
#[derive(Clone, Copy, Default)]
struct Moment {
    cycle: u64,
    awake: u64,
}

impl Meter {
    fn new(map: &Map) -> Self {
        let baud = map.buses().first().map_or(1, |bus| bus.baud.max(1));
        let byte_cycles = u64::from(board::QEMU_CLOCK_HZ / baud) * 10;
        let none = Moment::default();
        Self {
            byte_cycles,
            costs: Vec::new(),
            ticks: 0,
            packet: none,
            tick: None,
            goals: none,
            answers: None,
        }
    }

    /// A byte is out, the first of a packet where that `begins`.
    fn byte(&mut self, now: Moment, begins: bool) {
        if begins {
            self.packet = Moment { cycle: now.cycle.saturating_sub(self.byte_cycles), ..now };
        }
    }

    /// With this byte a packet is out, which so many bytes answer. `ticks` have their goals.
    fn packet(&mut self, now: Moment, answers: usize, ticks: u32) {
        self.answers = (answers > 0).then(|| now.cycle + answers as u64 * self.byte_cycles);
        if std::mem::replace(&mut self.ticks, ticks) == ticks {
            self.tick = self.tick.map(|(start, _)| (start, now));
            return;
        }
        if let Some((start, last)) = self.tick.replace((self.packet, now)) {
            let micros = |cycles: u64| cycles as f64 * 1e6 / f64::from(board::QEMU_CLOCK_HZ);
            let left = self.packet.cycle.saturating_sub(last.cycle);
            self.costs.push(Cost {
                awake: now.awake - self.goals.awake,
                bus_us: micros(last.cycle.saturating_sub(start.cycle)),
                left_us: micros(left.saturating_sub(self.packet.awake.saturating_sub(last.awake))),
            });
        }
        self.goals = now;
    }

    /// The cycle at which the last byte of the answers will be in, if any are on their way.
    const fn answered_at(&self) -> Option<u64> {
        self.answers
    }

    /// The answers are in; false where none were on their way.
    fn answered(&mut self, now: Moment) -> bool {
        if let Some((_, last)) = &mut self.tick {
            *last = now;
        }
        self.answers.take().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boards_log_is_read() {
        let (mut notes, mut rest) = (Vec::new(), Vec::new());
        for line in [
            "info: tick 0 state Reading",
            "info: tick 31 fault Silent { servo: 3 }",
            "info: tick 40 fault ",
            "info: tick 41 clip 2",
            "info: tick 42 stream Right",
            "info: tick 43 streamed 7 2 3 1",
            "info: tick soon",
            "warn: something",
        ] {
            read(line, &mut notes, &mut |line| rest.push(line.to_owned()));
        }
        let note = |tick, what, text: &str| Note { tick, what, text: text.to_owned() };
        let expected = [
            note(0, NoteKind::State, "Reading"),
            note(31, NoteKind::Fault, "Silent { servo: 3 }"),
            note(40, NoteKind::Fault, ""),
            note(41, NoteKind::Clip, "2"),
            note(42, NoteKind::Stream, "Right"),
            note(43, NoteKind::Streamed, "7 2 3 1"),
        ];
        assert_eq!(
            (notes, rest),
            (expected.to_vec(), vec!["info: tick soon".to_owned(), "warn: something".to_owned()])
        );
    }

    #[test]
    fn a_tick_is_metered_from_its_goals_to_its_answers() {
        let text = "servo_hz = 50\nbaud = 1_000_000\n[[joint]]\nname = 'a'\nchannel = 'rradius.rx'\nid = 1\nrange = [-10, 20]\n\
                    max_speed = 50\n";
        let map = puppet_file::Puppet::parse(std::path::Path::new("p.toml"), text.to_owned()).unwrap();
        let mut meter = Meter::new(&map.map(&mocap::sample::clip().skeleton).unwrap());
        let at = |cycle, awake| Moment { cycle, awake };
        // A byte is 250 cycles. Goals of two bytes, a question of one, ten bytes of answer; then the next goals.
        for (start, awake, ticks) in [(10_000, 500, 1), (510_000, 2_500, 2)] {
            meter.byte(at(start + 250, awake), true);
            meter.byte(at(start + 500, awake + 100), false);
            meter.packet(at(start + 500, awake + 100), 0, ticks);
            meter.byte(at(start + 1_000, awake + 300), true);
            meter.packet(at(start + 1_000, awake + 300), 10, ticks);
            assert_eq!(meter.answered_at(), Some(start + 3_500));
            assert!(
                meter.answered(at(start + 3_500, awake + 900))
                    && !meter.answered(at(start + 3_500, awake + 900))
            );
        }
        let [cost] = meter.costs[..] else { panic!("{:?}", meter.costs) };
        // From 10,000 to 13,500, and from there to 510,000 without the 1,100 cycles awake.
        assert_eq!(cost, Cost { awake: 2_000, bus_us: 140.0, left_us: (496_500.0 - 1_100.0) / 25.0 });
    }
}
