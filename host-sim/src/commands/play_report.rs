//! What `bunraku play` says: while it plays, and in the end.

use host_sim::play::{Performance, Recording, seconds};
use host_sim::ports::{Played, Told};
use indicatif::{ProgressBar, ProgressStyle};
use puppet_file::Map;
use serde_json::{Map as Object, Value};

/// How a core's cycles were spent.
#[derive(Clone, Copy)]
pub struct Spent {
    cycles: u64,
    asleep: u64,
    clock_hz: u32,
    /// The part in which it was not asleep.
    awake: f64,
}

impl Spent {
    /// Of so many cycles so many asleep.
    pub fn of(cycles: u64, asleep: u64, clock_hz: u32) -> Self {
        Self { cycles, asleep, clock_hz, awake: 1.0 - asleep as f64 / cycles as f64 }
    }
}

/// Figures as JSON.
pub struct Figures(Object<String, Value>);

impl Figures {
    /// With more of them.
    pub fn with(mut self, more: impl IntoIterator<Item = (&'static str, Value)>) -> Value {
        self.0.extend(more.into_iter().map(|(name, value)| (name.to_owned(), value)));
        Value::Object(self.0)
    }
}

/// What was played, as JSON.
pub fn report(map: &Map, recording: &Recording, live: Option<&Played>, spent: Option<Spent>) -> Figures {
    let figures = serde_json::json!({
        "ticks": recording.ticks, "servos": map.joints().len(), "servo_hz": map.tick_hz(),
        "seconds": map.tick_micros(recording.ticks) as f64 / 1e6, "goals": recording.goals.len(),
        "cycles": spent.map(|spent| spent.cycles), "cycles_asleep": spent.map(|spent| spent.asleep),
        "awake": spent.map(|spent| spent.awake),
        "late_ticks": live.map(|live| live.late.ticks),
        "latest_ms": live.map(|live| live.late.most.as_secs_f64() * 1e3),
        "longest_bus_ms": live.map(|live| live.longest.as_secs_f64() * 1e3),
        "state": live.map(|live| format!("{:?}", live.state)),
    });
    Figures(match figures {
        Value::Object(figures) => figures,
        _ => Object::new(),
    })
}

/// The same in sentences.
pub fn print(name: &str, map: &Map, recording: &Recording, live: Option<&Played>, spent: Option<Spent>) {
    println!(
        "{name}: {} ticks at {} Hz on {} servos, {} s",
        recording.ticks,
        map.tick_hz(),
        map.joints().len(),
        seconds(map.tick_micros(recording.ticks))
    );
    if let Some(live) = live {
        println!(
            "  the buses took {:.2} ms of a tick at most, {} ticks began late; the puppet ends {:?}",
            live.longest.as_secs_f64() * 1e3,
            live.late.ticks,
            live.state
        );
    }
    if let Some(spent) = spent {
        println!(
            "  {} cycles at {} MHz, of which {} awake: {:.3} %, {:.0} cycles a tick",
            spent.cycles,
            spent.clock_hz / 1_000_000,
            spent.cycles - spent.asleep,
            100.0 * spent.awake,
            (spent.cycles - spent.asleep) as f64 / f64::from(recording.ticks.max(1)),
        );
    }
}

/// Shows on a terminal which clip plays, and where in it the player is; elsewhere only states and sentences.
pub struct Progress {
    bar: ProgressBar,
    clips: Vec<Shown>,
}

struct Shown {
    name: String,
    frames: u32,
    /// The frame that counts as 0.
    start: u32,
    fps: f64,
}

impl Progress {
    /// Before the first clip.
    pub fn new(performance: &Performance<'_>) -> Self {
        let start = |index| if index == 0 { performance.start } else { 0 };
        let clips = performance.clips.iter().enumerate().map(|(index, (name, clip))| {
            let own = clip.rate_centihertz();
            let rate = if performance.centihertz > 0 { performance.centihertz } else { own };
            let fps = f64::from(rate) / 100.0;
            Shown { name: name.clone(), frames: clip.frames(), start: start(index), fps }
        });
        let bar = ProgressBar::new(1);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {msg}") {
            bar.set_style(style);
        }
        Self { clips: clips.collect(), bar }
    }

    /// Shows what the player told.
    pub fn show(&self, told: Told<'_>) {
        match told {
            Told::Line(line) => self.bar.suspend(|| eprintln!("{line}")),
            Told::At { clip, frame } => {
                let Some(shown) = self.clips.get(usize::from(clip)) else { return };
                let frame = frame + shown.start;
                self.bar.set_length(shown.frames.into());
                self.bar.set_position(frame.into());
                let time = |frame: u32| f64::from(frame) / shown.fps;
                self.bar.set_message(format!(
                    "{} {:.1} of {:.1} s",
                    shown.name,
                    time(frame),
                    time(shown.frames)
                ));
            }
        }
    }

    /// Takes the bar away.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}
