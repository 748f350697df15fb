//! A show on one page that needs nothing else.

use super::file::Program;
use super::played::{Cost, PlayedShow};
use super::summary::{Summary, Track, tracks};
use crate::play::NoteKind;
use crate::plot::lines::{Plot, Series};
use crate::plot::page::{figure, page, table};
use crate::plot::spans::{Span, time_line};
use firmware::clips::LIVE;
use firmware::limits::FINE_BITS;
use firmware::map::Joint;
use maud::{Markup, html};

/// What this page has besides the style of all.
const OWN_STYLE: &str = "\
:root { --goal: #1a7f5a; --seen: #c2570c; --s0: #b9c2d0; --s1: #8fb4ee; --s2: #5d93e8; --s3: #e6b23c; --s4: #c9d4e6; --bad: #d4380d }
@media (prefers-color-scheme: dark) { :root { --goal: #56c596; --seen: #ff9a52; --s0: #3a4454; --s1: #35568c; --s2: #3f6fc0; --s3: #7a5e1c; --s4: #2b3442; --bad: #ff7a45 } }
polyline { fill: none; stroke-width: 1.3; stroke-linejoin: round } .goal { stroke: var(--goal) } .present { stroke: var(--seen); stroke-dasharray: 4 2 }
.error { stroke: var(--bad) } .speed { stroke: var(--bar) } .sudden { stroke: var(--seen); stroke-width: 0.8 } .left { stroke: var(--bar) } .busy { stroke: var(--seen) }
.limit { stroke: var(--soft); stroke-dasharray: 2 4 } .mark { stroke: var(--bad); stroke-width: 1; opacity: .55 } svg text.what { fill: var(--ink); font-size: 11.5px } svg text.on { fill: var(--ink) } svg text.unit { font-size: 11px }
.state { fill: var(--s0) } .state.Easing, .state.Returning { fill: var(--s1) } .state.Playing { fill: var(--s2) } .state.Stopping { fill: var(--s3) } .state.Holding, .state.Resting { fill: var(--s4) } .state.Limp, .state.LettingGo { fill: var(--bad) }
.made.Right { fill: var(--s2) } .made.Reckoned { fill: var(--bad) } .made.Eased { fill: var(--s3) }
.clip0 { fill: #56b4e9 } .clip1 { fill: #e69f00 } .clip2 { fill: #009e73 } .clip3 { fill: #cc79a7 } .clip4 { fill: #9e8e00 } .latched { fill: var(--bad) } svg text.on { paint-order: stroke; stroke: var(--panel); stroke-width: 2.5px }
.servos { display: grid; grid-template-columns: repeat(auto-fill, minmax(500px, 1fr)); gap: 10px } .servos figure { margin: 0 } .key b { font-weight: 600 } .key .g { color: var(--goal) } .key .p { color: var(--seen) }
.tiles { display: flex; flex-wrap: wrap; gap: 10px; margin: 14px 0 } .tiles div { background: var(--panel); border: 1px solid var(--line); border-radius: 8px; padding: 8px 14px } .tiles b { display: block; font-size: 19px; font-variant-numeric: tabular-nums } .good b { color: var(--goal) } .bad b { color: var(--bad) }
";

/// Width of the drawings that are as wide as the page.
const WIDE: f64 = 1100.0;

/// The page.
pub fn show_page(program: &Program, played: &PlayedShow, summary: &Summary) -> String {
    let seconds = summary.seconds;
    let tracks = tracks(program, played);
    let marks = &program.events;
    let place = match summary.on {
        "sim" => "the simulated Cortex-M4, which counts cycles",
        "qemu" => "a Cortex-M4 under QEMU",
        _ => "this machine",
    };
    let servos = program.map.joints().iter().zip(&tracks).zip(&summary.servos);
    let body = html! {
        h1 { (summary.name) }
        p class="soft" {
            (program.map.joints().len()) @if summary.on != "port" { " virtual" } " servos at " (program.map.tick_hz())
            " Hz, told by the firmware on " (place) ". Time counts ticks in which goals were sent."
        }
        (tiles(summary))
        (figure(
            html! { "What happened: states, clips, latched faults, and what was done to it" },
            time_line(WIDE, seconds, &rows(program, played, summary), marks),
        ))
        (faults(summary))
        (streams(summary))
        (over_all(program, played, summary, &tracks))
        h2 { "Servos" }
        p class="key soft" {
            b class="g" { "Goal" } " and " b class="p" { "present position" }
            " in degrees of the channel; dashed: the range. The red lines are what was done."
        }
        div class="servos" {
            @for ((joint, track), servo) in servos {
                (figure(
                    html! {
                        (servo.id) " " (servo.name)
                        (format!(": error {:.2}° rms, {:.2}° at most", servo.error_rms, servo.error_max))
                    },
                    servo_plot(joint, track, &servo.name, seconds, marks).draw(),
                ))
            }
        }
        (in_numbers(summary))
    };
    page(&format!("{}: a show", summary.name), OWN_STYLE, body)
}

fn tiles(summary: &Summary) -> Markup {
    let good = |good: bool| if good { "good" } else { "bad" };
    let end = match &summary.fault {
        None => summary.ends.clone(),
        Some(fault) => format!("{}, {fault}", summary.ends),
    };
    let error = summary.servos.iter().map(|servo| servo.error_rms).fold(0.0, f64::max);
    let mut tiles = vec![
        (good(summary.fault.is_none()), end, "in the end".to_owned()),
        ("", format!("{:.2} s", summary.seconds), format!("{} ticks", summary.ticks)),
        (
            good(summary.outside_limits == 0),
            summary.outside_limits.to_string(),
            format!("of {} goals outside limits", summary.goals),
        ),
        ("", summary.faults.len().to_string(), "faults latched".to_owned()),
        ("", format!("{error:.2}°"), "greatest error of a servo, rms".to_owned()),
    ];
    let slowest = summary.faults.iter().filter_map(|fault| fault.settled_ms).fold(0.0, f64::max);
    if !summary.faults.is_empty() {
        tiles.push((
            good(slowest <= 100.0),
            format!("{slowest:.0} ms"),
            "from a fault to a held pose, at most".to_owned(),
        ));
    }
    if !summary.streams.is_empty() {
        let concealed: u32 = summary.streams.iter().map(|stream| stream.concealed).sum();
        tiles.push(("", concealed.to_string(), "streamed frames concealed".to_owned()));
    }
    if let Some(cost) = &summary.cost {
        tiles.push(("", format!("{:.2} ms", cost.left_us_median / 1e3), "left of a tick, median".to_owned()));
        tiles.push((good(cost.overrun == 0), cost.overrun.to_string(), "ticks overrun".to_owned()));
        tiles.push(("", format!("{:.0}", cost.awake_mean), "cycles awake a tick, mean".to_owned()));
    }
    html! {
        div class="tiles" {
            @for (class, value, what) in tiles { div class=(class) { b { (value) } (what) } }
        }
    }
}

/// States, clips and latched faults as stretches of time.
fn rows<'a>(program: &Program, played: &PlayedShow, summary: &Summary) -> Vec<(&'a str, Vec<Span>)> {
    let hz = f64::from(program.map.tick_hz());
    let spans = |what: NoteKind, class: &dyn Fn(&str) -> String, text: &dyn Fn(&str) -> String| {
        let notes: Vec<_> = played.notes.iter().filter(|note| note.what == what).collect();
        let ends = notes.iter().skip(1).map(|note| f64::from(note.tick) / hz).chain([summary.seconds]);
        let with_ends = notes.iter().zip(ends).filter(|(note, _)| !note.text.is_empty());
        with_ends
            .map(|(note, to)| Span {
                from: f64::from(note.tick) / hz,
                to,
                class: class(&note.text),
                text: text(&note.text),
            })
            .filter(|span| span.to > span.from)
            .collect::<Vec<_>>()
    };
    let clip = |text: &str| {
        let clip = text.parse::<usize>().ok().and_then(|number| program.clips.get(number));
        match clip {
            Some((name, ..)) => name.clone(),
            None if text.parse() == Ok(LIVE) => "live".to_owned(),
            None => text.to_owned(),
        }
    };
    let made = |text: &str| {
        let words = [("Right", "received"), ("Reckoned", "concealed"), ("Eased", "eased")];
        words.iter().find(|(made, _)| *made == text).map_or(text, |(_, word)| word).to_owned()
    };
    let colour = |text: &str| format!("clip{}", text.parse::<usize>().unwrap_or(0) % 5);
    vec![
        ("state", spans(NoteKind::State, &|text| format!("state {text}"), &str::to_owned)),
        ("clip", spans(NoteKind::Clip, &colour, &clip)),
        ("stream", spans(NoteKind::Stream, &|text| format!("made {text}"), &made)),
        ("fault", spans(NoteKind::Fault, &|_| "latched".to_owned(), &str::to_owned)),
    ]
}

fn faults(summary: &Summary) -> Markup {
    if summary.faults.is_empty() {
        return html! {};
    }
    let rows = html! {
        @for fault in &summary.faults {
            tr {
                td { (format!("{:.2} s", fault.at)) }
                td { (fault.fault) }
                td { (fault.state) }
                td { @match fault.settled_ms { Some(ms) => (format!("{ms:.0} ms")), None => "never" } }
                td { @match fault.acknowledged_at { Some(at) => (format!("{at:.2} s")), None => "no" } }
            }
        }
    };
    html! { h2 { "Faults" } (table(&["latched", "fault", "state reached", "after", "acknowledged"], rows)) }
}

fn streams(summary: &Summary) -> Markup {
    if summary.streams.is_empty() {
        return html! {};
    }
    let heads = ["from", "to", "frames as sent", "concealed", "on the way back", "passed over"];
    let rows = html! {
        @for stream in &summary.streams {
            tr {
                td { (format!("{:.2} s", stream.from)) }
                td { (format!("{:.2} s", stream.to)) }
                td { (stream.played) }
                td { (stream.concealed) }
                td { (stream.eased) }
                td { (stream.lost) }
            }
        }
    };
    html! { h2 { "Live streams" } (table(&heads, rows)) }
}

/// Error, speed and deadline of all servos together.
fn over_all(program: &Program, played: &PlayedShow, summary: &Summary, tracks: &[Track]) -> Markup {
    let joints = program.map.joints();
    let ticks = summary.ticks as usize;
    let most = |of: &dyn Fn(&Joint, &Track, usize) -> Option<f64>| -> Vec<Option<f64>> {
        let at = |tick| {
            let all = joints.iter().zip(tracks).filter_map(|(joint, track)| of(joint, track, tick));
            all.fold(None, |most: Option<f64>, value| Some(most.map_or(value, |most| most.max(value))))
        };
        (0..ticks).map(at).collect()
    };
    let goal = |track: &Track, tick: usize| track.goal.get(tick).copied().flatten().map(f64::from);
    let error = most(&|joint, track, tick| {
        let before = goal(track, tick.checked_sub(1)?)?;
        Some((f64::from(*track.present.get(tick)?) - before).abs() / joint.scale.to_num::<f64>().abs())
    });
    let fine = f64::from(1 << FINE_BITS);
    let speed = most(&|joint, track, tick| {
        let step = goal(track, tick)? - goal(track, tick.checked_sub(1)?)?;
        Some(100.0 * (step.abs() - 1.0).max(0.0) / (f64::from(joint.max_velocity) / fine))
    });
    let sudden = most(&|joint, track, tick| {
        let (now, before) = (goal(track, tick)?, goal(track, tick.checked_sub(1)?)?);
        let change = now - 2.0 * before + goal(track, tick.checked_sub(2)?)?;
        Some(100.0 * (change.abs() - 2.0).max(0.0) / (f64::from(joint.max_acceleration) / fine))
    });
    let top = |values: &[Option<f64>]| values.iter().flatten().fold(0.0, |top: f64, value| top.max(*value));
    let plot = |label, range, unit, limits, series| Plot {
        label,
        size: (WIDE, 170.0),
        seconds: summary.seconds,
        range,
        unit,
        limits,
        marks: &program.events,
        series,
    };
    let range = (0.0, (top(&error) * 1.08).max(1.0));
    let error = vec![Series { class: "error", values: error }];
    let moving = vec![Series { class: "sudden", values: sudden }, Series { class: "speed", values: speed }];
    html! {
        h2 { "All servos" }
        (figure(
            html! { "Tracking error: how far the servo that is furthest off is from the goal of the tick before" },
            plot("Tracking error", range, "degrees", vec![], error).draw(),
        ))
        (figure(
            html! {
                span class="key" {
                    "The goals' " b { "velocity" } " (blue) and " b class="p" { "acceleration" }
                    " as shares of the joints' limits, of the joint that has most; jumps of goals that a servo was not \
                     there to take are cut off"
                }
            },
            plot("Velocity and acceleration", (0.0, 120.0), "% of the limit", vec![100.0], moving).draw(),
        ))
        @if !played.costs.is_empty() {
            @let tick_ms = 1e3 / f64::from(program.map.tick_hz());
            @let longest = played.costs.iter().map(|cost| cost.bus_us / 1e3).fold(tick_ms, f64::max);
            (figure(
                html! {
                    span class="key" {
                        (format!("Of each tick of {tick_ms:.2} ms: the ")) b class="p" { "time on the bus" }
                        ", and what was " b { "left" }
                        " (blue) when the last answer was in and the core had done all it had to"
                    }
                },
                plot("Deadline margin", (0.0, longest * 1.05), "ms", vec![tick_ms], deadline(&played.costs)).draw(),
            ))
        }
    }
}

/// What each tick spends on the bus, and what is left of it.
fn deadline(costs: &[Cost]) -> Vec<Series<'static>> {
    let values = |of: fn(&Cost) -> f64| costs.iter().map(|cost| Some(of(cost) / 1e3)).collect();
    vec![
        Series { class: "busy", values: values(|cost| cost.bus_us) },
        Series { class: "left", values: values(|cost| cost.left_us) },
    ]
}

fn servo_plot<'a>(
    joint: &Joint,
    track: &Track,
    name: &'a str,
    seconds: f64,
    marks: &'a [(f64, String)],
) -> Plot<'a> {
    let scale = joint.scale.to_num::<f64>();
    let angle = |goal: i32| f64::from(goal - joint.zero) / scale;
    let (one, other) = (angle(joint.min), angle(joint.max));
    let goal: Vec<_> = track.goal.iter().map(|goal| goal.map(angle)).collect();
    let present: Vec<_> = track.present.iter().map(|present| Some(angle(*present))).collect();
    let all = || goal.iter().chain(&present).flatten();
    let low = all().copied().fold(f64::INFINITY, f64::min);
    let high = all().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = ((high - low) * 0.08).max(1.0);
    Plot {
        label: name,
        size: (540.0, 150.0),
        seconds,
        range: (low - room, high + room),
        unit: "",
        limits: vec![one, other],
        marks,
        series: vec![Series { class: "goal", values: goal }, Series { class: "present", values: present }],
    }
}

fn in_numbers(summary: &Summary) -> Markup {
    let heads = [
        "joint",
        "servo",
        "error, rms",
        "error, most",
        "at",
        "speed, of its limit",
        "acceleration, of its limit",
        "ticks missed",
        "goals outside limits",
    ];
    let rows = html! {
        @for servo in &summary.servos {
            tr {
                td { (servo.name) }
                td { (servo.id) }
                td { (format!("{:.3}°", servo.error_rms)) }
                td { (format!("{:.2}°", servo.error_max)) }
                td { (format!("{:.2} s", servo.error_max_at)) }
                td { (format!("{:.0} %", 100.0 * servo.speed)) }
                td { (format!("{:.0} %", 100.0 * servo.acceleration)) }
                td { (servo.missed) }
                td { (servo.outside_limits) }
            }
        }
    };
    html! { h2 { "In numbers" } (table(&heads, rows)) }
}
