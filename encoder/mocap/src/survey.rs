//! What a recording holds, before anything is done with it: ranges, speeds, whole turns, flips, and a T-pose in front.

use crate::angles::{self, Matrix};
use crate::clip::Clip;
use crate::motion::Motion;
use crate::skeleton::{Channel, Skeleton};

/// What a channel does. In degrees, or in centimetres of a length.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSurvey {
    /// Lowest and highest value, as recorded.
    pub low: f64,
    /// See [`low`](Self::low).
    pub high: f64,
    /// Greatest change between two frames, for a second: jumps by whole turns and Euler flips are not counted.
    pub speed: f64,
    /// Whole turns between the lowest and the highest value, once jumps by whole turns are undone.
    pub turns: u32,
    /// Jumps by a whole turn, such as from 179 to -179 degrees.
    pub wraps: usize,
}

/// Frames where all three angles of a joint jump, and its rotation does not: an Euler flip at a gimbal lock.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flips {
    /// Index of the joint.
    pub joint: usize,
    /// The frames behind the jumps, ascending.
    pub frames: Vec<usize>,
}

/// A first frame from which the motion does not go on: a T-pose that was put in front of it.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstFrameJump {
    /// The channel that jumps most.
    pub channel: usize,
    /// By how many degrees.
    pub degrees: f64,
}

/// What a recording holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// One for each channel.
    pub channels: Vec<ChannelSurvey>,
    /// Joints that flip.
    pub flips: Vec<Flips>,
    /// Whether frame 0 is apart from the others.
    pub jump: Option<FirstFrameJump>,
}

/// A jump of angles that counts as a flip, and the most that the rotation turns there, in degrees.
const FLIP: (f64, f64) = (90.0, 30.0);

/// A jump between frames 0 and 1 that counts, in degrees, and how often it is the greatest of the [`AFTER`] steps after it.
const JUMP: (f64, f64) = (10.0, 3.0);
const AFTER: usize = 30;

impl Survey {
    /// Looks at every frame once or twice.
    ///
    /// # Panics
    /// If the skeleton has another number of channels than the motion, or there is no frame.
    pub fn of(clip: &Clip) -> Self {
        let Clip { skeleton, motion } = clip;
        let (mut unwrapped, mut smooth) = (motion.clone(), motion.clone());
        unwrapped.unwrap_angles(skeleton);
        smooth.unflip(skeleton);
        let channels = skeleton.channels.iter().enumerate().map(|(channel, Channel { dof, .. })| {
            survey_channel(motion, &unwrapped, &smooth, channel, dof.is_rotation())
        });
        Self { channels: channels.collect(), flips: flips(skeleton, motion), jump: jump(skeleton, &smooth) }
    }
}

fn column(motion: &Motion, channel: usize) -> impl Iterator<Item = f64> + Clone + '_ {
    motion.samples[channel..].iter().step_by(motion.channels).copied()
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

fn steps(values: impl Iterator<Item = f64> + Clone) -> impl Iterator<Item = f64> {
    values.clone().skip(1).zip(values).map(|(to, from)| (to - from).abs())
}

fn survey_channel(
    motion: &Motion,
    unwrapped: &Motion,
    smooth: &Motion,
    channel: usize,
    rotates: bool,
) -> ChannelSurvey {
    let (low, high) = range(column(motion, channel));
    let (lowest, highest) = range(column(unwrapped, channel));
    // Where the recorded value and the unwrapped one part by another number of turns than a frame before.
    let turns = column(motion, channel)
        .zip(column(unwrapped, channel))
        .map(|(raw, whole)| ((whole - raw) / 360.0).round());
    ChannelSurvey {
        low,
        high,
        speed: steps(column(smooth, channel)).fold(0.0, f64::max) * motion.fps,
        turns: if rotates { ((highest - lowest) / 360.0) as u32 } else { 0 },
        wraps: steps(turns.collect::<Vec<_>>().into_iter()).filter(|step| *step > 0.0).count(),
    }
}

fn rotation(axes: [usize; 3], triple: [f64; 3]) -> Matrix {
    let factors = axes.iter().zip(triple).map(|(&axis, angle)| angles::rotation(axis, angle));
    factors.fold(angles::IDENTITY, |product, factor| angles::multiply(&product, &factor))
}

fn flips(skeleton: &Skeleton, motion: &Motion) -> Vec<Flips> {
    let (jump, turn) = FLIP;
    let mut found = Vec::new();
    for (index, joint) in skeleton.joints.iter().enumerate() {
        let Some(triple) = joint.euler_triple(skeleton) else { continue };
        let axes = triple.map(|channel| skeleton.channels[channel].dof.axis().unwrap_or(0));
        let at = |frame: usize| triple.map(|channel| motion.frame(frame)[channel]);
        let is_flip = |frame: &usize| {
            let (before, now) = (at(frame - 1), at(*frame));
            // All three jump only where the other way to write the rotation is nearer.
            let nearest = angles::nearest_triple(now, before);
            let flipped = angles::wrap(nearest[0] - now[0]).abs() > 90.0;
            let largest = (0..3).map(|k| angles::wrap(now[k] - before[k]).abs()).fold(0.0, f64::max);
            let step = angles::multiply(&angles::transpose(&rotation(axes, before)), &rotation(axes, now));
            flipped && largest > jump && angles::turned(&step) < turn
        };
        let frames: Vec<usize> = (1..motion.frames()).filter(is_flip).collect();
        if !frames.is_empty() {
            found.push(Flips { joint: index, frames });
        }
    }
    found
}

fn jump(skeleton: &Skeleton, smooth: &Motion) -> Option<FirstFrameJump> {
    let rotations: Vec<usize> =
        (0..smooth.channels).filter(|&channel| skeleton.channels[channel].dof.is_rotation()).collect();
    let step = |frame: usize| {
        let (from, to) = (smooth.frame(frame), smooth.frame(frame + 1));
        let changes =
            rotations.iter().map(|&channel| (channel, angles::wrap(to[channel] - from[channel]).abs()));
        changes.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    if smooth.frames() < 4 {
        return None;
    }
    let (channel, degrees) = step(0);
    let after = (1..smooth.frames() - 1).take(AFTER).map(|frame| step(frame).1).fold(0.0, f64::max);
    let (least, times) = JUMP;
    (degrees > least && degrees > times * after).then_some(FirstFrameJump { channel, degrees })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::bvh;
    use crate::sample;

    fn clip(rows: &str) -> Clip {
        let text = format!(
            "HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\nCHANNELS 4 Yposition Zrotation Xrotation Yrotation\nEnd Site\n{{\n\
             OFFSET 1 2 3\n}}\n}}\nMOTION\nFrames: {}\nFrame Time: 0.1\n{rows}",
            rows.lines().count()
        );
        bvh::parse(text.as_bytes(), "x.bvh", 1.0, None).expect("a clip").clip
    }

    #[test]
    fn ranges_speeds_and_turns() {
        let survey = Survey::of(&clip("5 0 0 170\n7 90 0 -175\n4 180 0 175\n4 -90 0 175\n4 10 0 175\n"));
        let height = ChannelSurvey { low: 4.0, high: 7.0, speed: 30.0, turns: 0, wraps: 0 };
        assert_eq!(survey.channels[0], height);
        // It goes round once, and on by 10 degrees.
        let turning = &survey.channels[1];
        assert_eq!((turning.low, turning.high, turning.turns, turning.wraps), (-90.0, 180.0, 1, 1));
        assert!((turning.speed - 1000.0).abs() < 1e-9, "{turning:?}");
        // From 170 to -175 and back are 15 degrees.
        let swinging = &survey.channels[3];
        assert_eq!((swinging.low, swinging.high, swinging.turns, swinging.wraps), (-175.0, 175.0, 0, 2));
        assert!((swinging.speed - 150.0).abs() < 1e-9, "{swinging:?}");
        assert!(survey.flips.is_empty());
    }

    #[test]
    fn flips_are_jumps_of_the_angles_and_not_of_the_pose() {
        // The third row is the second one's rotation and a little more, written in the other way.
        let survey =
            Survey::of(&clip("0 10 88 20\n0 10 89 20\n0 190 90.5 200\n0 190 89 201\n0 11 89.5 21\n"));
        assert_eq!(survey.flips, [Flips { joint: 0, frames: vec![2, 4] }]);
        assert!(survey.channels[1].speed < 60.0, "{survey:?}");
        // A true jump of one angle is none.
        assert!(Survey::of(&clip("0 10 8 20\n0 10 9 20\n0 190 9 20\n0 190 9 21\n")).flips.is_empty());
    }

    #[test]
    fn a_pose_in_front_that_the_motion_does_not_go_on_from() {
        let mut clip = sample::clip();
        assert_eq!(Survey::of(&clip).jump, None);
        // A T-pose: the arms sideways.
        let arm = clip.skeleton.channel("rhumerus.rz").expect("a channel of the sample");
        clip.motion.samples[arm] -= 80.0;
        let jump = Survey::of(&clip).jump.expect("a jump");
        assert_eq!(jump.channel, arm);
        assert!((jump.degrees - 80.0).abs() < 1.0, "{jump:?}");
    }
}
