//! Plays clips or follows live frames on ports, each tick when it is due by a clock.

use super::clock::Clock;
use super::end;
use super::serial::block_on;
use crate::play::{Note, Notes, Performance, Recording, Taken};
use crate::puppet::joint_names::JointNames;
use anyhow::Result;
use firmware::control_loop::{Surroundings, control_loop};
use firmware::decoder_list::SingleClip;
use firmware::fault::{Fault, Feedback};
use firmware::follow::{Counters, Follow, goal_map};
use firmware::library::Library;
use firmware::machine::{Command, Machine, Show, Start, State};
use firmware::map::MAX_SERVOS;
use puppet_file::Map;
use servo_wire::bus::{BusError, Goal, Reading, ServoBus};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// What a player tells on its way.
#[derive(Clone, Copy, Debug)]
pub enum Told<'t> {
    /// A state, or a sentence.
    Line(&'t str),
    /// Each tick while a clip plays: its number, and the frame that it is at.
    At {
        /// The clip.
        clip: u16,
        /// The frame.
        frame: u32,
    },
}

/// Ticks that began after the next one was due.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Late {
    /// How many.
    pub ticks: u32,
    /// How long after it was due itself the latest of them began.
    pub most: Duration,
}

/// What playing on a port came to.
#[derive(Clone, Debug)]
pub struct Played {
    /// What the servos were told, with the time since the first tick, and where they were.
    pub recording: Recording,
    /// What changed, in order, with its tick since goals were sent.
    pub notes: Vec<Note>,
    /// Ticks that were late.
    pub late: Late,
    /// Longest time that the buses took in a tick.
    pub longest: Duration,
    /// Where the puppet was in the end.
    pub state: State,
    /// Why it did not come to its end: the fault that was latched. The servos then hold, or not, as the puppet's policy says.
    pub failed: Option<String>,
}

/// Plays from finding the servos to rest.
///
/// `asked` counts how often somebody asked for an end: once, and the puppet stops smoothly and goes home; twice, and it
/// is left where it is, held by its servos. `say` is told of each state.
///
/// # Errors
/// Where clips and map do not fit together.
pub fn play(
    performance: &Performance<'_>,
    map: &Map,
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(Told<'_>),
) -> Result<Played> {
    performance.with_machine(map, |machine| {
        let names = performance.names.or_ids(map);
        Ok(perform(machine, (&names, performance.torque_off), bus, clock, asked, say, &mut |_| None))
    })
}

/// Follows live frames in goal units that come as bytes, from finding the servos until somebody asks for an end or the one who sends
/// falls silent for `lost_millis` (0: may be silent for ever), which is a fault; otherwise as [`play`].
///
/// # Errors
/// None that the map does not have already.
pub fn follow(
    input: &Receiver<Vec<u8>>,
    lost_millis: u16,
    (map, names): (&Map, &JointNames),
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(Told<'_>),
) -> Result<(Played, Counters)> {
    let map = goal_map(map)?;
    let follow = Follow::new(&map, lost_millis);
    let (mut garbage, mut foreign) = (false, false);
    let mut tick = |say: &mut dyn FnMut(Told<'_>)| {
        input.try_iter().for_each(|bytes| follow.feed(&bytes));
        let counters = follow.counters();
        // As many may begin a frame that is still on its way.
        if counters.skipped() > 4 && !std::mem::replace(&mut garbage, true) {
            say(Told::Line("bytes came that are no frame, and are skipped"));
        }
        if counters.foreign > 0 && !std::mem::replace(&mut foreign, true) {
            say(Told::Line("frames came for ids that the puppet does not have, and are ignored"));
        }
        follow.tick().then_some(Command::LinkLost)
    };
    let show = Show { playlist: &[0], ..Show::default() };
    let machine = Machine::new(&map, SingleClip::<_>::new(follow.frames(), None), show, Start::Power);
    let played = perform(machine, (names, false), bus, clock, asked, say, &mut tick);
    Ok((played, follow.counters()))
}

/// May command something in each tick.
type EachTick<'t> = dyn FnMut(&mut dyn FnMut(Told<'_>)) -> Option<Command> + 't;

/// Performs what a machine has been told to.
fn perform<L: Library>(
    mut machine: Machine<'_, L, MAX_SERVOS>,
    (names, torque_off): (&JointNames, bool),
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(Told<'_>),
    each_tick: &mut EachTick<'_>,
) -> Played {
    let map = machine.map();
    let acted = Cell::new(Duration::ZERO);
    let mut bus = Watched {
        bus,
        clock,
        acted: &acted,
        start: None,
        busy: Duration::ZERO,
        longest: Duration::ZERO,
        buses: map.joints().iter().map(|joint| joint.bus).collect(),
        taken: Vec::new(),
        positions: map.joints().iter().map(|joint| joint.home).collect(),
        present: Vec::new(),
    };
    let mut surroundings = Ticks {
        map,
        clock,
        start: clock.now(),
        acted: &acted,
        asked,
        told: 0,
        say,
        each_tick,
        notes: Notes::default(),
        ticks: 0,
        late: Late::default(),
    };
    let ids: Vec<u8> = map.joints().iter().map(|joint| joint.id).collect();
    block_on(control_loop(&mut machine, &mut bus, &mut surroundings));
    // Watchdogs stay armed until each servo has confirmed that it let go.
    let unconfirmed = machine.may_hold().map(|index| (index, BusError::Corrupt));
    let mut kept: end::Kept = unconfirmed.filter(|_| machine.state() == State::LettingGo).collect();
    if torque_off && machine.fault().is_none() && machine.at_rest() {
        kept = end::let_go(&mut bus.bus, &ids, clock);
        surroundings.tell(&end::told(&kept, ids.len(), names));
        // Those that no bus lets go are no failure.
        kept.retain(|(_, why)| *why != BusError::Unsupported);
    }
    // The others hold their last goal, or are slack; their watchdogs would turn the next player's goals down.
    if map.settings().servo_watchdog_millis > 0 {
        let armed: Vec<usize> = kept.iter().map(|(index, _)| *index).collect();
        if let Some(sentence) = end::disarm(&mut bus.bus, &ids, &armed, names) {
            surroundings.tell(&sentence);
        }
    }
    let late = surroundings.late;
    let mut failed = machine.fault().map(|fault| match fault {
        Fault::Late => format!("{fault}: {}", why_late(late, bus.longest, map)),
        _ => names.fault(fault),
    });
    if !kept.is_empty() {
        let kept = end::told(&kept, ids.len(), names);
        failed = Some(failed.map_or(kept.clone(), |why| format!("{why}; {kept}")));
    }
    let recording = Recording {
        ticks: surroundings.ticks,
        goals: bus.taken,
        present: bus.present,
        ..Recording::default()
    };
    let notes = surroundings.notes.all;
    Played { recording, notes, late, longest: bus.longest, state: machine.state(), failed }
}

/// How late ticks were, and what can be done.
fn why_late(late: Late, longest: Duration, map: &Map) -> String {
    let millis = |time: Duration| time.as_secs_f64() * 1e3;
    let tick = Duration::from_micros(map.tick_micros(1));
    let advice = if longest > tick {
        "raise the servos' and the puppet's `baud`, set the adapter's latency timer to 1 ms, or lower `servo_hz`"
    } else {
        "this computer was busy with something else: end that, or lower the puppet's `servo_hz`"
    };
    format!(
        "{} ticks began after the next one was due, the latest {:.1} ms after its own time; a tick has {:.1} ms, of which the buses \
         took {:.1} ms at most; {advice}",
        late.ticks,
        millis(late.most),
        millis(tick),
        millis(longest)
    )
}

/// A bus, what goes over it, and how long that takes.
struct Watched<'c, B, C> {
    bus: B,
    clock: &'c C,
    /// Time that actions have taken since somebody looked: servos that are looked for, turned on and watched one by one.
    acted: &'c Cell<Duration>,
    start: Option<Duration>,
    /// Time that this tick's goals and action have taken.
    busy: Duration,
    longest: Duration,
    /// The bus of each joint.
    buses: Vec<u8>,
    taken: Vec<Taken>,
    /// Where each servo was when it was read last.
    positions: Vec<i32>,
    /// The same as the goals of each tick were taken.
    present: Vec<Vec<i32>>,
}

impl<B, C: Clock> Watched<'_, B, C> {
    /// Notes what an action took that began at `start`.
    fn acted(&self, start: Duration) {
        self.acted.set(self.acted.get() + self.clock.now() - start);
    }

    /// Adds what a call took that began at `start`.
    fn took(&mut self, start: Duration) {
        self.busy += self.clock.now() - start;
        self.longest = self.longest.max(self.busy);
    }
}

impl<B: ServoBus, C: Clock> ServoBus for Watched<'_, B, C> {
    fn reads(&self, index: usize) -> bool {
        self.bus.reads(index)
    }

    async fn ping(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.ping(ids, index).await;
        self.acted(start);
        result
    }

    async fn set_torque(&mut self, ids: &[u8], index: usize, on: bool) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.set_torque(ids, index, on).await;
        self.acted(start);
        result
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        let now = self.clock.now();
        self.busy = Duration::ZERO;
        let time_us = (now - *self.start.get_or_insert(now)).as_micros() as u64;
        let result = self.bus.write_goals(goals).await;
        if result.is_ok() {
            let taken = goals.iter().zip(&self.buses);
            self.taken.extend(taken.map(|(goal, &bus)| Taken {
                time_us,
                bus,
                id: goal.id,
                position: goal.position,
            }));
            self.present.push(self.positions.clone());
        }
        self.took(now);
        result
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.read_all(ids, readings).await;
        for (position, reading) in self.positions.iter_mut().zip(readings.iter()) {
            *position = reading.map_or(*position, |reading| reading.position);
        }
        self.took(start);
        result
    }

    async fn reboot(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.reboot(ids, index).await;
        self.acted(start);
        result
    }

    async fn set_watchdog(&mut self, ids: &[u8], millis: u16) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.set_watchdog(ids, millis).await;
        self.acted(start);
        result
    }

    async fn disarm_watchdog(&mut self, ids: &[u8], index: usize) -> Result<(), BusError> {
        self.bus.disarm_watchdog(ids, index).await
    }
}

/// Ticks when they are due.
struct Ticks<'a, C> {
    map: &'a Map,
    clock: &'a C,
    /// When tick 0 was due.
    start: Duration,
    acted: &'a Cell<Duration>,
    asked: &'a AtomicUsize,
    /// How often of that the machine was told.
    told: usize,
    say: &'a mut dyn FnMut(Told<'_>),
    each_tick: &'a mut EachTick<'a>,
    notes: Notes,
    ticks: u32,
    late: Late,
}

impl<C> Ticks<'_, C> {
    fn tell(&mut self, what: &str) {
        (self.say)(Told::Line(what));
    }
}

impl<L: Library, C: Clock> Surroundings<L, MAX_SERVOS> for Ticks<'_, C> {
    async fn wait(&mut self, tick: u32) -> bool {
        // An adapter that takes 16 ms an exchange takes long to turn on many servos; time waits for it as long.
        let due = self.start + Duration::from_micros(self.map.tick_micros(tick));
        self.start += self.acted.take().min(self.clock.now().saturating_sub(due));
        let due = self.start + Duration::from_micros(self.map.tick_micros(tick));
        let next = self.start + Duration::from_micros(self.map.tick_micros(tick.wrapping_add(1)));
        self.clock.until(due).await;
        let now = self.clock.now();
        let late = now > next;
        if late {
            self.late.ticks += 1;
            self.late.most = self.late.most.max(now - due);
        }
        self.ticks = tick;
        late
    }

    fn control(&mut self, machine: &mut Machine<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        let state = machine.state();
        let tick = self.notes.count(machine);
        if self.notes.look(tick, machine) {
            self.tell(&format!("{state:?}"));
        }
        if let Some((clip, frame, _)) = machine.mixer().position() {
            (self.say)(Told::At { clip, frame });
        }
        let asked = self.asked.load(Ordering::Relaxed);
        // What is not on yet needs no way home.
        if asked > 1 || asked == 1 && matches!(state, State::Finding | State::Reading) {
            return false;
        }
        if asked > self.told {
            self.told = asked;
            self.tell("asked to end: stopping, then home (once more, and it is left where it is)");
            // Going home is refused to nobody.
            let _ = machine.command(Command::Home);
        }
        if let Some(command) = (self.each_tick)(self.say) {
            // A lost link is refused by nobody.
            let _ = machine.command(command);
        }
        !machine.at_rest()
    }

    fn feed(&mut self) {}
}
