//! Fit itself: a recording in, the values of a puppet's joints out.

use crate::chain::Chain;
use crate::euler;
use crate::hinge::{self, Hinge};
use crate::plan::{Bones, Follows, Joint, Plan, Turn};
use crate::report::{BoneReport, Excess, JointReport, Pole, Report, TwistReport, ends};
use crate::smooth::{self, Limits};
use crate::track::{Candidate, MOST_JOINTS, Track, Values, turned};
use crate::twist::{Twist, twist};
use mocap::angles::{IDENTITY, Matrix, apply, multiply, transpose};
use mocap::body::{Body, Part, TPose};
use mocap::skeleton::{Channel, Dof, Joint as Bone, Origin, Skeleton};
use mocap::{Clip, Motion};
use std::f64::consts::FRAC_1_SQRT_2;

/// A bone whose direction is off by less than this, in degrees, is where it should be.
const NEAR: f64 = 0.5;

/// Parts that are judged by where they face.
const TRUNK: [Part; 5] = [Part::Hips, Part::Spine, Part::Chest, Part::Neck, Part::Head];

/// A puppet's clip, and what the puppet cannot do of the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// One channel for each joint, named as [`channel_name`] says, in the plan's order.
    pub clip: Clip,
    /// What became of the recording.
    pub report: Report,
}

/// The name of a joint's channel in a fitted clip: `NAME.rx` in degrees, `NAME.tx` in centimetres.
pub fn channel_name(joint: &Joint) -> String {
    format!("{}.{}", joint.name, dof(joint).name())
}

const fn dof(joint: &Joint) -> Dof {
    if joint.is_rotation { Dof::Rx } else { Dof::Tx }
}

/// The way of a joint.
struct Way {
    /// The fitted values.
    values: Vec<f64>,
    /// What is recorded, without the range, where something is.
    recorded: Option<Vec<f64>>,
    /// How far each frame is beyond what the joint can do.
    beyond: Vec<f64>,
}

/// Fits a recording to a puppet; `smooth` brings each joint within its speed and acceleration.
///
/// Costs some 20 µs a frame and chain, 1 µs a frame and other joint.
///
/// # Panics
/// If the plan names channels, joints or chains that there are not, or the clip has no frame.
pub fn fit(plan: &Plan, clip: &Clip, smooth: bool) -> Fitted {
    let fps = clip.motion.fps;
    let recording = Recording::of(plan, clip);
    let mut ways: Vec<Option<Way>> = plan.joints.iter().map(|_| None).collect();
    channels(plan, clip, &mut ways);
    for (index, joint) in plan.joints.iter().enumerate() {
        if let Follows::Turns(turns) = &joint.follows {
            ways[index] = Some(recording.turns(joint, turns));
        }
    }
    for chain in 0..plan.chains.len() {
        recording.chain(plan, chain, &mut ways);
    }
    let mut ways: Vec<Way> =
        ways.into_iter().map(|way| way.expect("every joint follows something")).collect();
    let mut joints = Vec::new();
    for (joint, way) in plan.joints.iter().zip(&mut ways) {
        let limits =
            Limits { range: joint.range, speed: joint.max_speed, acceleration: joint.max_acceleration };
        let smoothed = smooth.then(|| {
            let before = std::mem::take(&mut way.values);
            way.values = smooth::within(&before, fps, &limits);
            let squares = before.iter().zip(&way.values).map(|(before, after)| (before - after).powi(2));
            (squares.sum::<f64>() / before.len() as f64).sqrt()
        });
        joints.push(JointReport {
            name: joint.name.clone(),
            unit: if joint.is_rotation { "°" } else { "cm" },
            recorded: way.recorded.as_deref().map(ends),
            fitted: ends(&way.values),
            out_of_range: Excess::of(way.beyond.iter().copied(), fps),
            too_fast: Excess::of_differences(&way.values, 1, joint.max_speed, fps),
            too_sudden: Excess::of_differences(&way.values, 2, joint.max_acceleration, fps),
            smoothed,
        });
    }
    let bones = recording.bones(plan, clip, &ways);
    let twist = |hinge: &Hinge| TwistReport {
        bone: clip.skeleton.joints[hinge.upper].name.clone(),
        part: hinge.part.to_string(),
        degrees: hinge.degrees,
        is_known: hinge.is_known,
    };
    let twists = recording.hinges.iter().map(twist).collect();
    Fitted { clip: as_clip(plan, fps, &ways), report: Report { joints, bones, twists } }
}

/// Joints that follow channels: without flips and turns, and by whole turns where the joint can be.
fn channels(plan: &Plan, clip: &Clip, ways: &mut [Option<Way>]) {
    let followed =
        |joint: &Joint| if let Follows::Channel(channel) = joint.follows { Some(channel) } else { None };
    let followers = |channels: &[usize]| -> Vec<usize> {
        let follows =
            |index: &usize| followed(&plan.joints[*index]).is_some_and(|own| channels.contains(&own));
        (0..plan.joints.len()).filter(follows).collect()
    };
    let fps = clip.motion.fps;
    for bone in 0..clip.skeleton.joints.len() {
        let Some(channels) = euler::triple(&clip.skeleton, bone) else { continue };
        let indices = followers(&channels);
        if indices.is_empty() {
            continue;
        }
        // The angles, or their twins: whichever the joints can do better, together.
        let branches = euler::continuous(&clip.motion, channels).map(|triples| {
            let of_joint = |&index: &usize| {
                let joint = &plan.joints[index];
                let place = channels.iter().position(|&own| Some(own) == followed(joint)).unwrap_or(0);
                let values: Vec<f64> = triples.iter().map(|angles| angles[place] + joint.offset).collect();
                by_turns(joint, values, Some(360.0), None, fps)
            };
            indices.iter().map(of_joint).collect::<Vec<_>>()
        });
        let cost = |ways: &[(Way, f64)]| ways.iter().map(|(_, cost)| cost).sum::<f64>();
        let [straight, twins] = branches;
        let best = if cost(&twins) < cost(&straight) { twins } else { straight };
        for (index, (way, _)) in indices.into_iter().zip(best) {
            ways[index] = Some(way);
        }
    }
    for (index, joint) in plan.joints.iter().enumerate() {
        if let Follows::Goals { channel, zero, scale } = joint.follows {
            let values = clip.motion.iter().map(|pose| (pose[channel] - zero) / scale).collect();
            ways[index] = Some(by_turns(joint, values, None, None, fps).0);
        }
        if let (Some(channel), None) = (followed(joint), &ways[index]) {
            let values = clip.motion.iter().map(|pose| pose[channel] + joint.offset).collect();
            let period = joint.is_rotation.then_some(360.0);
            ways[index] = Some(by_turns(joint, values, period, None, fps).0);
        }
    }
}

/// The way of a joint that should have these values, up to whole periods, and what is left; `certainty` says how much
/// each frame counts, from 0 to 1.
fn by_turns(
    joint: &Joint,
    values: Vec<f64>,
    period: Option<f64>,
    certainty: Option<&[f64]>,
    fps: f64,
) -> (Way, f64) {
    let weight = |frame: usize| certainty.map_or(1.0, |certainty| certainty[frame]);
    let frames: Vec<Vec<Candidate>> = values
        .iter()
        .enumerate()
        .map(|(frame, value)| turned(*value, period, joint.range, weight(frame)))
        .collect();
    let (way, cost) = Track { fps, max_speed: [joint.max_speed; MOST_JOINTS] }.best(&frames);
    let mut fitted: Vec<f64> = way.into_iter().map(|values| values[0]).collect();
    let recorded: Vec<f64> = values
        .iter()
        .zip(&fitted)
        .map(|(value, fitted)| {
            period.map_or(*value, |period| value + ((fitted - value) / period).round() * period)
        })
        .collect();
    let beyond = recorded.iter().zip(&fitted).map(|(recorded, fitted)| (recorded - fitted).abs()).collect();
    if let Some(certainty) = certainty {
        rest_where_uncertain(&mut fitted, certainty, fps);
    }
    (Way { values: fitted, recorded: Some(recorded), beyond }, cost)
}

/// Where a twist is not defined, its joint goes from what was before to what comes then.
///
/// Least squares: each value counts by its certainty, each step by what is uncertain about it; a tridiagonal system.
fn rest_where_uncertain(values: &mut [f64], certainty: &[f64], fps: f64) {
    let stillness = crate::track::STILLNESS * fps * fps;
    let bond = |frame: usize| {
        let certain = certainty[frame].min(certainty[frame + 1]);
        stillness * (1.0 - certain).powi(2)
    };
    // What is left of each frame's equation after those before are put in: own · x = wish + bond · next.
    let mut left: Vec<[f64; 2]> = Vec::with_capacity(values.len());
    for (frame, value) in values.iter().enumerate() {
        // A frame that says nothing at all still has a value.
        let weight = certainty[frame].max(1e-9);
        let (mut own, mut wish) = (weight, weight * value);
        if frame + 1 < values.len() {
            own += bond(frame);
        }
        if let (Some([before, above]), true) = (left.last(), frame > 0) {
            let bond = bond(frame - 1);
            own += bond - bond * bond / before;
            wish += bond * above / before;
        }
        left.push([own, wish]);
    }
    let mut next = 0.0;
    for frame in (0..values.len()).rev() {
        let [own, wish] = left[frame];
        let after = if frame + 1 < values.len() { bond(frame) * next } else { 0.0 };
        next = (wish + after) / own;
        values[frame] = next;
    }
}

/// The rotations of the bones that a plan names, in all frames.
struct Recording {
    fps: f64,
    /// For each pair of bones the rotations of the one against the other.
    turned: Vec<(Bones, Vec<Matrix>)>,
    hinges: Vec<Hinge>,
    /// Where each bone points in the T-pose; `None` for those of the trunk and the head.
    directions: Vec<Option<[f64; 3]>>,
}

impl Recording {
    fn of(plan: &Plan, clip: &Clip) -> Self {
        let mut turned: Vec<(Bones, Vec<Matrix>)> = Vec::new();
        let turns = plan.joints.iter().flat_map(|joint| match &joint.follows {
            Follows::Turns(turns) => turns.iter().map(|(turn, _)| turn.bones).collect(),
            _ => Vec::new(),
        });
        for bones in turns.chain(plan.chains.iter().map(|chain| chain.bones)) {
            if !turned.iter().any(|(own, _)| *own == bones) {
                turned.push((bones, Vec::with_capacity(clip.motion.frames())));
            }
        }
        let figure = clip.figure();
        let body = Body::of(&figure);
        let mut t_pose = TPose::of(&figure, &body);
        let joints = clip.skeleton.joints.len();
        let is_trunk = |joint| body.part(joint).is_some_and(|part| TRUNK.contains(&part));
        let hinges = if turned.is_empty() {
            Vec::new()
        } else {
            hinge::hinges(clip, &body, &mut t_pose, &plan.twists)
        };
        let turn_of = |joint: usize| hinges.iter().find_map(|hinge| hinge.rotations[joint]);
        let direction = |joint| {
            let own = t_pose.direction(joint);
            turn_of(joint).map_or(own, |turn| apply(&transpose(&turn), own))
        };
        let directions = (0..joints).map(|joint| (!is_trunk(joint)).then(|| direction(joint))).collect();
        let mut rotations = vec![IDENTITY; joints];
        if !turned.is_empty() {
            for pose in clip.motion.iter() {
                t_pose.rotations(pose, &mut rotations);
                for (joint, rotation) in rotations.iter_mut().enumerate() {
                    if let Some(turn) = turn_of(joint) {
                        *rotation = multiply(rotation, &turn);
                    }
                }
                for (bones, frames) in &mut turned {
                    let against = bones.against.map_or(IDENTITY, |against| rotations[against]);
                    frames.push(multiply(&transpose(&against), &rotations[bones.bone]));
                }
            }
        }
        Self { fps: clip.motion.fps, turned, hinges, directions }
    }

    /// The direction of a bone by which joints with these axes are judged, in the T-pose.
    ///
    /// A limb is judged by where it points. Of the trunk and the head it matters where they face, since a bone that points
    /// up does not show that a head turns: the first of forward, up and sideways that every joint moves.
    fn direction(&self, bone: usize, axes: &[[f64; 3]]) -> [f64; 3] {
        let moves = |direction: &[f64; 3]| {
            let along = |axis: &[f64; 3]| (0..3).map(|k| axis[k] * direction[k]).sum::<f64>().abs();
            axes.iter().all(|axis| along(axis) < FRAC_1_SQRT_2)
        };
        let facing = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        self.directions[bone].unwrap_or_else(|| facing.into_iter().find(moves).unwrap_or(facing[0]))
    }

    fn rotations(&self, bones: Bones) -> &[Matrix] {
        self.turned.iter().find(|(own, _)| *own == bones).map_or(&[], |(_, frames)| frames)
    }

    /// A joint that follows a sum of turns.
    fn turns(&self, joint: &Joint, turns: &[(Turn, f64)]) -> Way {
        let mut sum: Vec<f64> = Vec::new();
        let mut certainty: Vec<f64> = Vec::new();
        for (turn, weight) in turns {
            let twists: Vec<Twist> =
                self.rotations(turn.bones).iter().map(|rotation| twist(rotation, turn.axis)).collect();
            let certain: Vec<f64> = twists.iter().map(|twist| twist.certainty).collect();
            // A turn by itself is one of at most half a turn either way.
            let alone = Joint { range: [-180.0, 180.0], ..joint.clone() };
            let angles = twists.iter().map(|twist| twist.degrees).collect();
            let way = by_turns(&alone, angles, Some(360.0), Some(&certain), self.fps).0;
            sum.resize(twists.len(), joint.offset);
            certainty.resize(twists.len(), 1.0);
            for (frame, value) in way.recorded.unwrap_or_default().into_iter().enumerate() {
                sum[frame] += weight * value;
                certainty[frame] = certainty[frame].min(certain[frame]);
            }
        }
        let weight = turns.first().map_or(1.0, |(_, weight)| weight.abs());
        let alike = weight > 0.0 && turns.iter().all(|(_, other)| other.abs() == weight);
        by_turns(joint, sum, alike.then_some(360.0 * weight), Some(&certainty), self.fps).0
    }

    /// The joints of a chain.
    fn chain(&self, plan: &Plan, number: usize, ways: &mut [Option<Way>]) {
        let bones = plan.chains[number].bones;
        let wanted = self.rotations(bones);
        let members: Vec<(usize, [f64; 3])> = plan
            .joints
            .iter()
            .enumerate()
            .filter_map(|(index, joint)| match joint.follows {
                Follows::Chain { chain, axis } if chain == number => Some((index, axis)),
                _ => None,
            })
            .collect();
        let joints = || members.iter().map(|(index, _)| &plan.joints[*index]);
        let axes: Vec<[f64; 3]> = members.iter().map(|(_, axis)| *axis).collect();
        let chain = Chain {
            direction: self.direction(bones.bone, &axes),
            axes,
            ranges: joints().map(|joint| joint.range.map(|end| (end - joint.offset).to_radians())).collect(),
        };
        let mut max_speed = [f64::INFINITY; MOST_JOINTS];
        joints().zip(&mut max_speed).for_each(|(joint, speed)| *speed = joint.max_speed);
        let mut way = Track { fps: self.fps, max_speed }.best(&chain.candidates(wanted)).0;
        chain.settle(&mut way, wanted, self.fps, &max_speed);
        let off: Vec<f64> =
            way.iter().zip(wanted).map(|(values, wanted)| chain.off(&radians(values), wanted)).collect();
        for (place, joint) in joints().enumerate() {
            let [min, max] = joint.range;
            let values: Vec<f64> =
                way.iter().map(|values| (values[place] + joint.offset).clamp(min, max)).collect();
            let at_end = |value: f64| value - min < 1e-6 || max - value < 1e-6;
            let beyond = values.iter().zip(&off);
            let beyond = beyond.map(|(value, off)| if at_end(*value) && *off > NEAR { *off } else { 0.0 });
            let beyond = beyond.collect();
            ways[members[place].0] = Some(Way { values, recorded: None, beyond });
        }
    }

    /// How far each driven bone is from where it was recorded.
    fn bones(&self, plan: &Plan, clip: &Clip, ways: &[Way]) -> Vec<BoneReport> {
        let name = |joint: usize| clip.skeleton.joints[joint].name.clone();
        let mut reports = Vec::new();
        for (bones, wanted) in &self.turned {
            // The joints that move this bone against that one and nothing else, as one chain.
            let members: Vec<(usize, [f64; 3])> = plan
                .joints
                .iter()
                .enumerate()
                .filter_map(|(index, joint)| match &joint.follows {
                    Follows::Chain { chain, axis } if plan.chains[*chain].bones == *bones => {
                        Some((index, *axis))
                    }
                    Follows::Turns(turns) => match turns.as_slice() {
                        [(turn, 1.0)] if turn.bones == *bones => Some((index, turn.axis)),
                        _ => None,
                    },
                    _ => None,
                })
                .collect();
            if members.is_empty() || members.len() > MOST_JOINTS {
                continue;
            }
            let axes: Vec<[f64; 3]> = members.iter().map(|(_, axis)| *axis).collect();
            let chain = Chain { direction: self.direction(bones.bone, &axes), axes, ranges: Vec::new() };
            let angles: Vec<f64> = wanted
                .iter()
                .enumerate()
                .map(|(frame, wanted)| {
                    let mut values = [0.0; MOST_JOINTS];
                    for ((index, _), value) in members.iter().zip(&mut values) {
                        *value = ways[*index].values[frame] - plan.joints[*index].offset;
                    }
                    chain.off(&radians(&values), wanted)
                })
                .collect();
            let mut report = BoneReport {
                bone: name(bones.bone),
                against: bones.against.map_or_else(|| "world".to_owned(), name),
                joints: members.iter().map(|(index, _)| plan.joints[*index].name.clone()).collect(),
                mean: 0.0,
                worst: 0.0,
                at: 0.0,
                pole: None,
            };
            report.see(&angles, self.fps);
            if members.len() == 2 && self.directions[bones.bone].is_some() {
                let near = |wanted: &Matrix| chain.from_first_axis(wanted) < Pole::NEAR;
                let near = wanted.iter().zip(&angles).filter(|(wanted, _)| near(wanted)).map(|(_, off)| *off);
                let (count, worst) =
                    near.fold((0.0, 0.0), |(count, most), off| (count + 1.0, f64::max(most, off)));
                report.pole = Some(Pole { frames: count / angles.len().max(1) as f64, worst });
            }
            reports.push(report);
        }
        reports
    }
}

fn radians(values: &Values) -> Values {
    values.map(f64::to_radians)
}

/// The values as a clip: a channel a joint, all of them at one root that does not move.
///
/// A joint's bone is so long that its end moves by 1 cm for a degree.
fn as_clip(plan: &Plan, fps: f64, ways: &[Way]) -> Clip {
    let bone = |name: &str, parent, channels: std::ops::Range<usize>| Bone {
        name: name.to_owned(),
        parent,
        offset: [0.0; 3],
        axis: IDENTITY,
        tail: if parent.is_some() { [0.0, 1_f64.to_degrees(), 0.0] } else { [0.0; 3] },
        rotations: channels.clone().filter(|&channel| plan.joints[channel].is_rotation).collect(),
        level: if parent.is_some() { 2 } else { 1 },
        channels,
    };
    let mut joints = vec![bone("(puppet)", None, 0..0)];
    let mut channels = Vec::new();
    for (index, joint) in plan.joints.iter().enumerate() {
        joints.push(bone(&joint.name, Some(0), index..index + 1));
        let name = channel_name(joint);
        channels.push(Channel { name, dof: dof(joint), joint: index + 1, limits: None });
    }
    let frames = ways.first().map_or(0, |way| way.values.len());
    let samples = (0..frames).flat_map(|frame| ways.iter().map(move |way| way.values[frame])).collect();
    Clip {
        // Whole turns were chosen, and are chosen no more.
        skeleton: Skeleton { joints, channels, origin: Origin::Table },
        motion: Motion { fps, channels: plan.joints.len(), samples },
    }
}
