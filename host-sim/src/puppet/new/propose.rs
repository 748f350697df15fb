//! From a recording to a proposal.

use super::figure::Figure;
use super::proposal::{Joint, Proposal, Proposed, Wish};
use super::servo::Servo;
use super::unit::Unit;
use anyhow::{Result, bail};
use fit::{BoneReport, Bones, Fitted, Follows, Plan, Pole, Turn};
use mocap::body::{Body, FoundBy, Part, goes_on_four_legs};
use mocap::survey::Survey;
use mocap::{Clip, Motion};

/// Every range is wider than the recording's by this part of it at each end, and by so many degrees.
const MARGIN: (f64, f64) = (0.05, 5.0);

/// A joint may be faster than the recording by this factor: fit and codec add a little.
const FASTER: f64 = 1.2;

/// The lowest `max_speed` of a joint, in degrees a second: to come to its pose before a clip begins.
const SLOWEST: f64 = 60.0;

/// Frames that may be beyond a range, of all: 0.1 %. A single wrong frame in a recording does not make a range.
const BEYOND: f64 = 0.001;

/// A bone that is further off near the axis of its first servo is told, in degrees.
const POLE: f64 = 10.0;

/// A joint that turns by less in the whole recording stands still, in degrees.
const STILL: f64 = 1.0;

/// What is said of a figure that is no person.
pub const FOUR_LEGS: &str = "the figure goes on four legs, and parts are named as a person's: \"upper arm\", \"forearm\" and \
    \"hand\" are those of its forelegs. Joints are at 0 where it would stand as a person in a T-pose";

/// Proposes a puppet for the figure of this recording.
///
/// # Errors
/// A sentence where the skeleton has none of the parts that are asked for, or no servo may be used.
pub fn propose(clip: &Clip, wish: &Wish) -> Result<Proposal> {
    let body = Body::of(&clip.figure());
    let mut notes = Vec::new();
    let all = Unit::all(&body);
    let clip = &if Survey::of(clip).jump.is_some() {
        notes.push(
            "left out: frame 0, from which the figure jumps to the next, so that frame 0 may be a T-pose. Encode \
             with --frames 1.. too"
                .to_owned(),
        );
        let Motion { fps, channels, samples } = &clip.motion;
        let samples = samples.iter().skip(*channels).copied().collect();
        Clip { skeleton: clip.skeleton.clone(), motion: Motion { fps: *fps, channels: *channels, samples } }
    } else {
        clip.clone()
    };
    let guessed: Vec<String> = Part::ALL
        .into_iter()
        .filter(|&part| body.found_by(part) == Some(FoundBy::Geometry))
        .filter_map(|part| Some(format!("{part} is {}", clip.skeleton.joints[body.joint(part)?].name)))
        .collect();
    if !guessed.is_empty() {
        notes.push(format!("guessed by the figure's shape, since names do not say: {}", guessed.join(", ")));
    }
    if goes_on_four_legs(clip, &body) {
        notes.push(FOUR_LEGS.to_owned());
    }
    let mut units = all;
    units.retain(|unit| wish.groups.contains(&unit.group));
    for group in &wish.groups {
        if !units.iter().any(|unit| unit.group == *group) {
            notes.push(format!("left out: {group}, since the skeleton has no such joints that we know"));
        }
    }
    if units.is_empty() {
        let names: Vec<&str> = clip.skeleton.joints.iter().map(|joint| joint.name.as_str()).take(8).collect();
        bail!(
            "the skeleton has none of these parts: {}. Its joints are {}{}. Write a puppet.toml with `channel = \
             \"JOINT.rx\"` for each servo (docs/PUPPET.md)",
            wish.groups.iter().map(|group| group.name()).collect::<Vec<_>>().join(", "),
            names.join(", "),
            if clip.skeleton.joints.len() > names.len() { ", ..." } else { "" }
        );
    }
    let servo = Servo::of(wish.kind);
    let mut first = fitted(clip, &body, &units, &servo);
    let still = still(&first, &units);
    if still.iter().all(|still| *still) {
        bail!(
            "no joint turns by {STILL} degree or more in {} frames, so there is no range to take: give a recording that \
             moves",
            clip.motion.frames()
        );
    }
    if still.contains(&true) {
        let mut moves = still.iter().map(|still| !still);
        let (moving, resting): (Vec<Unit>, _) = units.into_iter().partition(|_| moves.next() == Some(true));
        let resting: Vec<&str> = resting.iter().map(|unit| unit.name.as_str()).collect();
        notes.push(format!("left out, since the recording does not turn them: {}", resting.join(", ")));
        units = moving;
        first = fitted(clip, &body, &units, &servo);
    }
    if let Some(servos) = wish.servos {
        units = choose(&first, units, servos, &mut notes)?;
    }
    choose_axes(clip, &body, &mut units, &servo, &mut notes);
    let last = fitted(clip, &body, &units, &servo);
    notes.extend(last.report.bones.iter().filter_map(pole));
    let mut values = values(&last).into_iter();
    let mut proposed = Vec::new();
    for unit in units {
        let joints = unit.axes.iter().zip(&mut values);
        let joints = joints
            .map(|(axis, values)| {
                joint(unit.joint_name(axis), axis.axis, &values, clip.motion.fps, &servo, &mut notes)
            })
            .collect();
        proposed.push(Proposed { unit, joints });
    }
    let joints = proposed.iter().flat_map(|unit| &unit.joints);
    let fast = joints.filter(|joint| joint.recorded_speed > servo.speed);
    let fast: Vec<String> = fast.map(|joint| format!("{} {:.0}", joint.name, joint.recorded_speed)).collect();
    if !fast.is_empty() {
        notes.push(format!(
            "at times faster than the {:.0} degrees a second of a servo such as {}: {}",
            servo.speed,
            servo.model,
            fast.join(", ")
        ));
    }
    let figure = Figure::of(clip, &last.report.twists);
    Ok(Proposal { servo, units: proposed, figure, notes })
}

/// The recording on these units, where each joint may go as far as a human's, as fast as the servo can.
fn fitted(clip: &Clip, body: &Body, units: &[Unit], servo: &Servo) -> Fitted {
    let mut plan = Plan { joints: Vec::new(), chains: Vec::new(), twists: Vec::new() };
    for unit in units {
        let Some(bone) = body.joint(unit.bone) else { continue };
        let bones = Bones { bone, against: body.joint(unit.against) };
        if unit.axes.len() > 1 {
            plan.chains.push(fit::Chain { name: unit.name.clone(), bones });
        }
        for axis in &unit.axes {
            let follows = match unit.axes.len() {
                1 => Follows::Turns(vec![(Turn { bones, axis: axis.axis }, 1.0)]),
                _ => Follows::Chain { chain: plan.chains.len() - 1, axis: axis.axis },
            };
            plan.joints.push(fit::Joint {
                name: unit.joint_name(axis),
                follows,
                is_rotation: true,
                offset: 0.0,
                range: axis.reach,
                max_speed: servo.speed,
                max_acceleration: f64::MAX,
            });
        }
    }
    fit::fit(&plan, clip, false)
}

/// The values of all joints in all frames, in the order of the units.
fn values(fitted: &Fitted) -> Vec<Vec<f64>> {
    let motion = &fitted.clip.motion;
    (0..motion.channels).map(|channel| motion.iter().map(|frame| frame[channel]).collect()).collect()
}

/// What is told of a bone that two servos cannot follow where it points along the axis of the first one.
fn pole(bone: &BoneReport) -> Option<String> {
    let pole = bone.pole.filter(|pole| pole.worst == bone.worst && bone.worst > POLE)?;
    Some(format!(
        "{}: in {:.1} % of the frames {} points along the axis of the first one, to within {:.0} degrees, where two servos cannot \
         follow: up to {:.0} degrees off. A third servo in the chain can",
        bone.joints.join(" and "),
        100.0 * pole.frames,
        bone.bone,
        Pole::NEAR,
        bone.worst
    ))
}

/// How far a unit's bone is from where it was recorded, in degrees: the mean over all frames.
fn off(fitted: &Fitted, unit: &Unit) -> f64 {
    let first = unit.joint_name(&unit.axes[0]);
    let bone = fitted.report.bones.iter().find(|bone| bone.joints.contains(&first));
    bone.map_or(0.0, |bone| bone.mean)
}

/// Which units turn less than [`STILL`] in all frames.
fn still(fitted: &Fitted, units: &[Unit]) -> Vec<bool> {
    let mut values = values(fitted).into_iter();
    let width = |values: Vec<f64>| {
        let ends = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (f64::min(low, *value), f64::max(high, *value))
        });
        ends.1 - ends.0
    };
    let rests = |unit: &Unit| !values.by_ref().take(unit.axes.len()).map(width).any(|width| width >= STILL);
    units.iter().map(rests).collect()
}

/// Takes the other axes of the units that follow the recording better with them, and tells where left and right differ.
fn choose_axes(clip: &Clip, body: &Body, units: &mut [Unit], servo: &Servo, notes: &mut Vec<String>) {
    let mut others = units.to_vec();
    for unit in &mut others {
        if let (Some(axes), 2) = (unit.others.take(), unit.axes.len()) {
            unit.axes = axes.to_vec();
        }
    }
    let (one, other) = (fitted(clip, body, units, servo), fitted(clip, body, &others, servo));
    let mut changed = Vec::new();
    for (unit, others) in units.iter_mut().zip(others) {
        if off(&other, &others) < off(&one, unit) {
            changed.push(unit.name.clone());
            *unit = others;
        }
    }
    let twin = |name: &str| match name.split_once(' ') {
        Some(("right", limb)) => format!("left {limb}"),
        Some((_, limb)) => format!("right {limb}"),
        None => String::new(),
    };
    for name in &changed {
        let twin = twin(name);
        if !changed.contains(&twin) && units.iter().any(|unit| unit.name == twin) {
            notes.push(format!(
                "the servos of the {name} stand in another order than those of the {twin}: each follows the recording better so"
            ));
        }
    }
}

/// The units that move most and need no more than so many servos; with more servos than they need, longer chains.
fn choose(fitted: &Fitted, units: Vec<Unit>, servos: usize, notes: &mut Vec<String>) -> Result<Vec<Unit>> {
    let mut values = values(fitted).into_iter();
    let moved = |unit: &Unit| {
        let deviations = values.by_ref().take(unit.axes.len()).map(|values| deviation(&values));
        deviations.fold(0.0, f64::max)
    };
    let mut order: Vec<(f64, usize)> = units.iter().map(moved).zip(0..).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = servos;
    let mut chosen = Vec::new();
    for &(_, index) in &order {
        if let Some(rest) = left.checked_sub(units[index].axes.len()) {
            left = rest;
            chosen.push(index);
        }
    }
    if chosen.is_empty() {
        bail!("no part of the figure can be moved with {servos} servos, expected 1 or more");
    }
    let out: Vec<&str> = (order.iter().map(|&(_, index)| index))
        .filter(|index| !chosen.contains(index))
        .map(|index| units[index].name.as_str())
        .collect();
    if !out.is_empty() {
        notes.push(format!(
            "left out, since they move less, or need more than what is left of {servos} servos: {}",
            out.join(", ")
        ));
    }
    let longer: Vec<usize> =
        chosen.iter().copied().filter(|&index| units[index].more.is_some()).take(left).collect();
    if left > longer.len() {
        notes.push(format!("{} of {servos} servos have nothing to do", left - longer.len()));
    }
    let units = units.into_iter().enumerate().filter(|(index, _)| chosen.contains(index));
    Ok(units
        .map(|(index, mut unit)| {
            unit.axes.extend(unit.more.take().filter(|_| longer.contains(&index)));
            unit
        })
        .collect())
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

fn joint(
    name: String,
    axis: [f64; 3],
    values: &[f64],
    fps: f64,
    servo: &Servo,
    notes: &mut Vec<String>,
) -> Joint {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let recorded = [sorted[0], sorted[last]];
    let cut = (last as f64 * BEYOND / 2.0) as usize;
    let (part, degrees) = MARGIN;
    let margin = part * (sorted[last - cut] - sorted[cut]) + degrees;
    let mut range = [sorted[cut] - margin, sorted[last - cut] + margin];
    let width = servo.width() - 1.0;
    if range[1] - range[0] > width {
        range = fullest(&sorted, width);
        let beyond = values.iter().filter(|value| **value < range[0] || **value > range[1]).count();
        if beyond > 0 {
            notes.push(format!(
                "{name}: the recording goes from {:.0} to {:.0} degrees, and the servo turns {:.0}: {beyond} of {} \
                 frames are beyond it",
                recorded[0],
                recorded[1],
                servo.width(),
                values.len()
            ));
        }
    }
    let range = [range[0].ceil(), range[1].floor()];
    let goal = |zero: i32, value: f64| f64::from(zero) + (value * servo.goals_per_degree).round();
    // Away from the ends of the servo's turn by a twentieth of it, or else with the range in the middle.
    let spare = f64::from(servo.highest - servo.lowest) / 20.0;
    let fits = goal(servo.middle(), range[0]) >= f64::from(servo.lowest) + spare
        && goal(servo.middle(), range[1]) <= f64::from(servo.highest) - spare;
    let centre = f64::midpoint(range[0], range[1]);
    let zero = (!fits).then(|| servo.middle() - (centre * servo.goals_per_degree).round() as i32);
    let speeds = values.windows(2).map(|pair| (pair[1] - pair[0]).abs() * fps);
    let recorded_speed = speeds.fold(0.0, f64::max);
    let max_speed = (recorded_speed * FASTER).clamp(SLOWEST, servo.speed);
    Joint { name, axis, recorded, range, zero, recorded_speed, max_speed: max_speed.round() }
}

/// Of all ranges of this width the one with most values in it, with the values in its middle.
fn fullest(sorted: &[f64], width: f64) -> [f64; 2] {
    let mut best = (0, 0);
    let mut end = 0;
    for start in 0..sorted.len() {
        while end < sorted.len() && sorted[end] - sorted[start] <= width {
            end += 1;
        }
        if end - start > best.1 - best.0 {
            best = (start, end);
        }
    }
    let middle = f64::midpoint(sorted[best.0], sorted[best.1.saturating_sub(1)]);
    [middle - width / 2.0, middle + width / 2.0]
}
