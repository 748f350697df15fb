//! Plays a clip or follows live frames on ports, each tick when it is due by a clock.

use super::clock::Clock;
use super::serial::block_on;
use crate::play::{Recording, Taken};
use anyhow::{Result, bail};
use firmware::control_loop::{Surroundings, control_loop};
use firmware::decoder_list::SingleClip;
use firmware::fault::Feedback;
use firmware::follow::{Counters, Follow, goal_map};
use firmware::frames::Frames;
use firmware::library::Library;
use firmware::machine::{Command, Machine, Show, Start, State};
use firmware::map::MAX_SERVOS;
use firmware::playback::Playback;
use puppet_file::Map;
use servo_wire::bus::{BusError, Goal, Reading, ServoBus};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// What playing on a port came to.
#[derive(Clone, Debug)]
pub struct Played {
    /// What the servos were told, with the time since the first tick.
    pub recording: Recording,
    /// Ticks that began after the next one was due.
    pub late: u32,
    /// Longest time that the buses took in a tick.
    pub longest: Duration,
    /// Where the puppet was in the end.
    pub state: State,
}

/// Plays from finding the servos to rest.
///
/// `asked` counts how often somebody asked for an end: once, and the puppet stops smoothly and goes home; twice, and it
/// is left where it is, held by its servos. `say` is told of each state.
///
/// # Errors
/// Where clip and map do not fit together, and the fault where one was latched; the servos then hold, or not, as the
/// puppet's policy says.
pub fn play(
    frames: &mut dyn Frames,
    map: &Map,
    rate: u16,
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(&str),
) -> Result<Played> {
    let frames =
        Playback::new(frames, map, false, 0).map(Playback::into_frames).map_err(|(error, _)| error)?;
    perform(SingleClip::new(frames, Some(rate)), map, bus, clock, asked, say, &mut || None)
}

/// Follows live frames in goal units that come as bytes, from finding the servos until somebody asks for an end or the one who sends
/// falls silent for `lost_millis` (0: may be silent for ever), which is a fault; otherwise as [`play`].
///
/// # Errors
/// As [`play`].
pub fn follow(
    input: &Receiver<Vec<u8>>,
    lost_millis: u16,
    map: &Map,
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(&str),
) -> Result<(Played, Counters)> {
    let map = goal_map(map)?;
    let follow = Follow::new(&map, lost_millis);
    let mut tick = || {
        input.try_iter().for_each(|bytes| follow.feed(&bytes));
        follow.tick().then_some(Command::LinkLost)
    };
    let played = perform(SingleClip::new(follow.frames(), None), &map, bus, clock, asked, say, &mut tick)?;
    Ok((played, follow.counters()))
}

/// Performs clip 0 of a library. `each_tick` may command something.
fn perform<L: Library>(
    library: L,
    map: &Map,
    bus: impl ServoBus,
    clock: &impl Clock,
    asked: &AtomicUsize,
    say: &mut dyn FnMut(&str),
    each_tick: &mut dyn FnMut() -> Option<Command>,
) -> Result<Played> {
    let show = Show { playlist: &[0], ..Show::default() };
    let mut machine = Machine::new(map, library, show, Start::Power);
    let acted = Cell::new(Duration::ZERO);
    let mut bus = Watched {
        bus,
        clock,
        acted: &acted,
        start: None,
        busy: Duration::ZERO,
        longest: Duration::ZERO,
        taken: Vec::new(),
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
        state: None,
        ticks: 0,
        late: 0,
    };
    let ids: Vec<u8> = map.joints().iter().map(|joint| joint.id).collect();
    block_on(control_loop(&mut machine, &mut bus, &mut surroundings));
    // Servos hold their last goal; their watchdogs would turn the next player's goals down.
    if map.settings().servo_watchdog_millis > 0 {
        match block_on(bus.bus.set_watchdog(&ids, 0)) {
            Ok(()) | Err(BusError::Unsupported) => {}
            Err(error) => surroundings.tell(&format!("the servos' watchdogs stay armed: {error}")),
        }
    }
    if let Some(fault) = machine.fault() {
        bail!("{fault}");
    }
    let recording = Recording { ticks: surroundings.ticks, goals: bus.taken, ..Recording::default() };
    Ok(Played { recording, late: surroundings.late, longest: bus.longest, state: machine.state() })
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
    taken: Vec<Taken>,
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
            self.taken.extend(goals.iter().map(|goal| Taken {
                time_us,
                id: goal.id,
                position: goal.position,
            }));
        }
        self.took(now);
        result
    }

    async fn read_all(&mut self, ids: &[u8], readings: &mut [Option<Reading>]) -> Result<(), BusError> {
        let start = self.clock.now();
        let result = self.bus.read_all(ids, readings).await;
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
    say: &'a mut dyn FnMut(&str),
    each_tick: &'a mut dyn FnMut() -> Option<Command>,
    state: Option<State>,
    ticks: u32,
    late: u32,
}

impl<C> Ticks<'_, C> {
    fn tell(&mut self, what: &str) {
        (self.say)(what);
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
        let late = self.clock.now() > next;
        self.late += u32::from(late);
        self.ticks = tick;
        late
    }

    fn control(&mut self, machine: &mut Machine<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        let state = machine.state();
        if self.state.replace(state) != Some(state) {
            self.tell(&format!("{state:?}"));
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
        if let Some(command) = (self.each_tick)() {
            // A lost link is refused by nobody.
            let _ = machine.command(command);
        }
        !machine.at_rest()
    }

    fn feed(&mut self) {}
}
