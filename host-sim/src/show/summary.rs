//! What a show came to, in numbers.

use super::file::Program;
use super::played::{Cost, PlayedShow};
use crate::play::NoteKind;
use firmware::limits::FINE_BITS;
use firmware::map::Joint;
use serde::Serialize;

/// A servo's way through a show.
#[derive(Clone, Debug)]
pub struct Track {
    /// The goal that it took in each tick, in goal units.
    pub goal: Vec<Option<i32>>,
    /// Where it was when that came.
    pub present: Vec<i32>,
}

/// A servo in numbers. Angles are degrees of its channel (or cm), and shares those of the puppet's limits.
#[derive(Clone, Debug, Serialize)]
pub struct ServoSummary {
    /// Its id.
    pub id: u8,
    /// Its joint.
    pub name: String,
    /// How far it was from the goal of the tick before: root of the mean square.
    pub error_rms: f64,
    /// The same at most, and when.
    pub error_max: f64,
    /// See `error_max`, in seconds.
    pub error_max_at: f64,
    /// Its goals' highest velocity as a share of the limit.
    pub speed: f64,
    /// Their highest acceleration as a share of the limit.
    pub acceleration: f64,
    /// Ticks whose goal it did not take.
    pub missed: u32,
    /// Goals out of range, or further from where it was told to be than the limits allow.
    pub outside_limits: u32,
}

/// A fault that was latched.
#[derive(Clone, Debug, Serialize)]
pub struct FaultSummary {
    /// When, in seconds.
    pub at: f64,
    /// NoteKind.
    pub fault: String,
    /// Milliseconds until the puppet held, rested or was limp; `None` where it never was.
    pub settled_ms: Option<f64>,
    /// The state it settled in.
    pub state: String,
    /// When it was acknowledged, in seconds.
    pub acknowledged_at: Option<f64>,
    /// Whether servos were still being found, read and turned on, one by one and where they are: nothing moves then.
    pub while_starting: bool,
}

/// A live stream that has ended, in frames.
#[derive(Clone, Debug, Serialize)]
pub struct StreamSummary {
    /// When it began to play, and when it ended, in seconds.
    pub from: f64,
    /// See `from`.
    pub to: f64,
    /// Frames that were played as they were sent.
    pub played: u32,
    /// Frames that were made up, since the right ones were not there.
    pub concealed: u32,
    /// Frames on the way back from those.
    pub eased: u32,
    /// Frames that the decoder passed over on to an entry point.
    pub lost: u32,
}

/// Ticks on the simulated board.
#[derive(Clone, Debug, Serialize)]
pub struct CostSummary {
    /// Cycles awake in a tick, in the mean.
    pub awake_mean: f64,
    /// The same at most.
    pub awake_max: u64,
    /// Longest time on the bus in a tick, in µs.
    pub bus_us_max: f64,
    /// Least time left in a tick, in µs; that of half of the ticks is more than the median.
    pub left_us_min: f64,
    /// See `left_us_min`.
    pub left_us_median: f64,
    /// Ticks in which nothing was left.
    pub overrun: usize,
}

/// Ticks in a row on the simulated board in which nothing was left.
#[derive(Clone, Debug, Serialize)]
pub struct OverrunSummary {
    /// When the first of them began, in seconds.
    pub at: f64,
    /// How many there are.
    pub ticks: usize,
    /// The state of the puppet at the first.
    pub state: String,
    /// Longest time on the bus, in µs.
    pub bus_us_max: f64,
    /// Most cycles awake.
    pub awake_max: u64,
}

/// A show in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The show's name.
    pub name: String,
    /// Where it played.
    pub on: &'static str,
    /// The state in the end.
    pub ends: String,
    /// The fault that is latched in the end.
    pub fault: Option<String>,
    /// Ticks in which goals were sent.
    pub ticks: u32,
    /// Their time in seconds.
    pub seconds: f64,
    /// Goals that servos took.
    pub goals: usize,
    /// Instructions that servos refused.
    pub refused: u32,
    /// Goals outside limits, of all servos.
    pub outside_limits: u32,
    /// Faults in order.
    pub faults: Vec<FaultSummary>,
    /// Live streams in order.
    pub streams: Vec<StreamSummary>,
    /// Servos in the map's order.
    pub servos: Vec<ServoSummary>,
    /// Costs of ticks, where they were counted.
    pub cost: Option<CostSummary>,
    /// Where ticks took too long.
    pub overruns: Vec<OverrunSummary>,
}

impl Summary {
    /// The numbers of a run.
    pub fn new(program: &Program, played: &PlayedShow, on: &'static str) -> Self {
        let map = &program.map;
        let tracks = tracks(program, played);
        let hz = f64::from(map.tick_hz());
        let servos: Vec<ServoSummary> = map
            .joints()
            .iter()
            .zip(&tracks)
            .zip(&program.joints)
            .map(|((joint, track), name)| servo(joint, track, name, hz))
            .collect();
        Self {
            name: program.name.clone(),
            on,
            ends: played.ends().to_owned(),
            fault: played.fault().map(|fault| named(program, fault)),
            ticks: played.recording.ticks,
            seconds: f64::from(played.recording.ticks) / hz,
            goals: played.recording.goals.len(),
            refused: played.recording.refused,
            outside_limits: servos.iter().map(|servo| servo.outside_limits).sum(),
            faults: faults(program, played, hz),
            streams: streams(played, hz),
            servos,
            cost: cost(&played.costs),
            overruns: overruns(played, hz),
        }
    }
}

/// The servos' ways, in the map's order.
pub(super) fn tracks(program: &Program, played: &PlayedShow) -> Vec<Track> {
    let (map, recording) = (&program.map, &played.recording);
    let ticks = recording.ticks as usize;
    let column = |id: u8| map.joints().iter().position(|joint| joint.id == id);
    let mut tracks: Vec<Track> = (0..map.joints().len())
        .map(|index| Track {
            goal: vec![None; ticks],
            present: recording.present.iter().filter_map(|tick| tick.get(index).copied()).collect(),
        })
        .collect();
    for taken in &recording.goals {
        // Times are rounded down to the microsecond.
        let tick = (taken.time_us * u64::from(map.tick_hz())).div_ceil(1_000_000) as usize;
        if let Some(track) = column(taken.id).and_then(|index| tracks.get_mut(index))
            && let Some(goal) = track.goal.get_mut(tick)
        {
            *goal = Some(taken.position);
        }
    }
    tracks
}

fn servo(joint: &Joint, track: &Track, name: &str, hz: f64) -> ServoSummary {
    let per_unit = 1.0 / joint.scale.to_num::<f64>().abs();
    let fine = f64::from(1 << FINE_BITS);
    let (velocity, acceleration) =
        (f64::from(joint.max_velocity) / fine, f64::from(joint.max_acceleration) / fine);
    let mut summary = ServoSummary {
        id: joint.id,
        name: name.to_owned(),
        error_rms: 0.0,
        error_max: 0.0,
        error_max_at: 0.0,
        speed: 0.0,
        acceleration: 0.0,
        missed: track.goal.iter().filter(|goal| goal.is_none()).count() as u32,
        outside_limits: 0,
    };
    let (mut sum, mut count, mut last) = (0.0, 0u32, None);
    for (tick, pair) in track.goal.windows(2).enumerate() {
        let tick = tick + 1;
        let [before, goal] = *pair else { continue };
        let present = track.present.get(tick).copied();
        if let (Some(before), Some(present)) = (before, present) {
            let error = f64::from((present - before).abs()) * per_unit;
            (sum, count) = (sum + error * error, count + 1);
            if error > summary.error_max {
                (summary.error_max, summary.error_max_at) = (error, tick as f64 / hz);
            }
        }
        let Some(goal) = goal else {
            last = None;
            continue;
        };
        let step = before.map(|before| f64::from(goal - before));
        // Goals are whole units: a step may be one more than its limit. One that was lost goes on from where it is.
        let from_here = present.is_some_and(|present| f64::from((goal - present).abs()) <= velocity + 1.0);
        let too_far = step.is_some_and(|step| step.abs() > velocity + 1.0) && !from_here;
        let out = !(joint.min..=joint.max).contains(&goal) && !from_here;
        summary.outside_limits += u32::from(too_far || out);
        if let Some(step) = step.filter(|step| step.abs() <= velocity + 1.0) {
            // What is a unit is rounding.
            summary.speed = summary.speed.max((step.abs() - 1.0).max(0.0) / velocity);
            if let Some(last) = last.replace(step) {
                let change: f64 = step - last;
                summary.acceleration = summary.acceleration.max((change.abs() - 2.0).max(0.0) / acceleration);
            }
        } else {
            last = None;
        }
    }
    summary.error_rms = (sum / f64::from(count.max(1))).sqrt();
    summary
}

/// States in which servos are found, read and turned on.
const STARTING: [&str; 3] = ["Finding", "Reading", "Arming"];

fn faults(program: &Program, played: &PlayedShow, hz: f64) -> Vec<FaultSummary> {
    let settled = |text: &str| ["Holding", "Resting", "Limp", "LettingGo"].contains(&text);
    let mut faults = Vec::new();
    for (index, note) in played.notes.iter().enumerate() {
        if note.what != NoteKind::Fault || note.text.is_empty() {
            continue;
        }
        let state = played.notes[..index].iter().rev().find(|note| note.what == NoteKind::State);
        let later =
            played.notes[index..].iter().find(|note| note.what == NoteKind::State && settled(&note.text));
        let now = state.filter(|state| settled(&state.text) && !moved_on(played, index, note.tick));
        let reached = now.or(later);
        let acknowledged =
            played.notes[index..].iter().find(|note| note.what == NoteKind::Fault && note.text.is_empty());
        faults.push(FaultSummary {
            at: f64::from(note.tick) / hz,
            fault: named(program, &note.text),
            settled_ms: reached
                .map(|reached| f64::from(reached.tick.max(note.tick) - note.tick) * 1000.0 / hz),
            state: reached.map_or(String::new(), |reached| reached.text.clone()),
            acknowledged_at: acknowledged.map(|note| f64::from(note.tick) / hz),
            while_starting: state.is_none_or(|state| STARTING.contains(&state.text.as_str())),
        });
    }
    faults
}

fn streams(played: &PlayedShow, hz: f64) -> Vec<StreamSummary> {
    let (mut streams, mut began) = (Vec::new(), None);
    for note in &played.notes {
        let at = f64::from(note.tick) / hz;
        match note.what {
            NoteKind::Stream => _ = began.get_or_insert(at),
            NoteKind::Streamed => {
                let mut counts = note.text.split(' ').map(|count| count.parse().unwrap_or(0));
                let mut next = || counts.next().unwrap_or(0);
                streams.push(StreamSummary {
                    from: began.take().unwrap_or(at),
                    to: at,
                    played: next(),
                    concealed: next(),
                    eased: next(),
                    lost: next(),
                });
            }
            _ => {}
        }
    }
    streams
}

/// A fault with the servo's own id and its joint: `Silent { servo: 6 }` is `Silent: servo 7 (left shoulder swing)`.
fn named(program: &Program, fault: &str) -> String {
    let parsed = || {
        let (kind, rest) = fault.split_once(" { servo: ")?;
        let digits = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
        let index: usize = rest[..digits].parse().ok()?;
        let (joint, name) = (program.map.joints().get(index)?, program.joints.get(index)?);
        let more = rest[digits..].trim_end_matches('}').trim_end();
        Some(format!("{kind}: servo {} ({name}){more}", joint.id))
    };
    parsed().unwrap_or_else(|| fault.to_owned())
}

/// Whether the state changed in the tick in which a fault was noted.
fn moved_on(played: &PlayedShow, fault: usize, tick: u32) -> bool {
    played.notes[fault..].iter().any(|note| note.what == NoteKind::State && note.tick == tick)
}

fn overruns(played: &PlayedShow, hz: f64) -> Vec<OverrunSummary> {
    let state = |tick: usize| {
        let until = played.notes.iter().take_while(|note| note.tick as usize <= tick);
        until
            .filter(|note| note.what == NoteKind::State)
            .last()
            .map_or(String::new(), |note| note.text.clone())
    };
    let mut tick = 0;
    let rows =
        played.costs.chunk_by(|one, next| (one.left_us <= 0.0) == (next.left_us <= 0.0)).filter_map(|row| {
            let first = tick;
            tick += row.len();
            row.first().filter(|cost| cost.left_us <= 0.0).map(|_| OverrunSummary {
                at: first as f64 / hz,
                ticks: row.len(),
                state: state(first),
                bus_us_max: row.iter().map(|cost| cost.bus_us).fold(0.0, f64::max),
                awake_max: row.iter().map(|cost| cost.awake).max().unwrap_or(0),
            })
        });
    rows.collect()
}

fn cost(costs: &[Cost]) -> Option<CostSummary> {
    let awake = costs.iter().map(|cost| cost.awake);
    let count = costs.len();
    let mut left: Vec<f64> = costs.iter().map(|cost| cost.left_us).collect();
    left.sort_by(f64::total_cmp);
    (count > 0).then(|| CostSummary {
        awake_mean: awake.clone().sum::<u64>() as f64 / count as f64,
        awake_max: awake.max().unwrap_or(0),
        bus_us_max: costs.iter().map(|cost| cost.bus_us).fold(0.0, f64::max),
        left_us_min: left.first().copied().unwrap_or(0.0),
        left_us_median: left.get(count / 2).copied().unwrap_or(0.0),
        overrun: costs.iter().filter(|cost| cost.left_us <= 0.0).count(),
    })
}
