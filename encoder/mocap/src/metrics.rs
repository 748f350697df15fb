//! How far a decoded motion is from its original.
//!
//! Two averages say it in centimetres. One is over all joints and frames. The other is over those that move, so that a
//! long rest does not hide a short movement: see [`MOVES_CM`]. The largest error is that of points off the bones, which
//! show a bone that turns about itself as well: see [`POINTS_CM`].

use serde::Serialize;

use crate::angles;
use crate::kinematics::Kinematics;
use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// Why two motions cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    /// They differ in shape, or the reference does not fit the skeleton.
    #[error("the {what} has {found} {unit}, expected {expected} as in the {other}")]
    Shape {
        /// What has the wrong shape.
        what: &'static str,
        /// Its size.
        found: usize,
        /// Frames or channels.
        unit: &'static str,
        /// The size that it should have.
        expected: usize,
        /// What has that size.
        other: &'static str,
    },
    /// There is nothing to compare.
    #[error("the reference has 0 frames, expected at least 1")]
    Empty,
}

/// A joint moves in a frame where it is further than this from where it is [`MOVES_SECONDS`] before or after.
pub const MOVES_CM: f64 = 0.1;

/// See [`MOVES_CM`].
pub const MOVES_SECONDS: f64 = 0.1;

/// How far off a joint's position, along each of its own axes, the points are whose greatest distance is the largest error.
///
/// Source: the error metric of the Animation Compression Library (ACL), whose default shell distance is 3 cm. A joint of a
/// BVH is where ACL's bone begins. A joint of an ASF is the bone's end, where the same turn moves the points further.
pub const POINTS_CM: f64 = 3.0;

/// Errors of a decoded motion in cm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Distance of a joint, averaged over all joints and frames.
    pub mean_joint_cm: f64,
    /// The same, averaged over the joints and frames that move ([`MOVES_CM`]) alone; over all where nothing moves.
    pub moving_joint_cm: f64,
    /// The greatest distance of any point [`POINTS_CM`] off a joint.
    pub max_point_cm: f64,
}

impl Errors {
    /// The larger of the two averages.
    pub const fn mean_cm(&self) -> f64 {
        self.mean_joint_cm.max(self.moving_joint_cm)
    }
}

/// What `bunraku compare` reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Number of frames.
    pub frames: usize,
    /// Number of channels.
    pub channels: usize,
    /// Frames per second of the reference.
    pub fps: f64,
    /// Bytes of the decoded clip's file.
    pub bytes: u64,
    /// How many times larger the samples are as 4-byte floats: frames · channels · 4 / bytes.
    pub ratio_f32: f64,
    /// Displacement error per frame (DEF; the QMD paper names it in 5.2 but defines no unit): the sum over all
    /// joints of the distance between their positions in cm, averaged over frames.
    pub def_sum_cm: f64,
    /// The same, averaged over the joints too: `def_sum_cm` / joints. All joints count, with the root.
    pub mean_joint_cm: f64,
    /// The distance averaged over the joints and frames that move: [`Errors::moving_joint_cm`].
    pub moving_joint_cm: f64,
    /// The largest distance of any joint in any frame.
    pub max_joint_cm: f64,
    /// The greatest distance of points off the bones: [`Errors::max_point_cm`].
    pub max_point_cm: f64,
    /// Root of the mean squared difference of all rotation channels in degrees, by the shorter way round.
    pub rms_deg: f64,
    /// Peak signal-to-noise ratio of the rotation channels in dB: 10 · log10(Σ range² / Σ MSE) over channels,
    /// with the peak-to-peak range of the unwrapped reference as a channel's peak. `None` if there is no error
    /// or no movement.
    ///
    /// Sums, not a mean of each channel's own ratio: recordings have channels whose whole range is 1e-14
    /// degrees, and one lost bit there would outweigh the body.
    pub psnr_db: Option<f64>,
    /// All joints, those with the largest mean distance first.
    pub worst_joints: Vec<JointError>,
    /// Per frame, the largest distance of any joint.
    pub frame_max_cm: Vec<f64>,
}

/// One joint's error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointError {
    /// Name of the joint.
    pub name: String,
    /// Distance averaged over frames.
    pub mean_cm: f64,
    /// Largest distance.
    pub max_cm: f64,
}

/// Compares a decoded motion, whose file has `bytes` bytes, with its original.
///
/// Both have the skeleton's channels, in degrees and centimetres. Costs forward kinematics of both.
///
/// # Errors
/// Numbers of frames or channels that differ, or no frames.
pub fn compare(
    skeleton: &Skeleton,
    reference: &Motion,
    decoded: &Motion,
    bytes: u64,
) -> Result<Report, CompareError> {
    let evaluator = Evaluator::new(skeleton, reference)?;
    check("decoded motion", decoded.channels, "channels", reference.channels, "reference")?;
    check("decoded motion", decoded.frames(), "frames", reference.frames(), "reference")?;
    let frames = reference.frames();
    let mut frame_max_cm = vec![0.0_f64; frames];
    let mut joints: Vec<JointError> = (skeleton.joints.iter())
        .map(|joint| JointError { name: joint.name.clone(), mean_cm: 0.0, max_cm: 0.0 })
        .collect();
    evaluator.distances(&decoded.samples, |frame, joint, cm| {
        frame_max_cm[frame] = frame_max_cm[frame].max(cm);
        joints[joint].mean_cm += cm / frames as f64;
        joints[joint].max_cm = joints[joint].max_cm.max(cm);
    });
    let def_sum_cm = joints.iter().map(|joint| joint.mean_cm).sum();
    let Errors { moving_joint_cm, max_point_cm, .. } = evaluator.errors(&decoded.samples);
    let samples = frames as f64 * reference.channels as f64;
    let (rms_deg, psnr_db) = rotation_error(skeleton, reference, decoded);
    joints.sort_by(|a, b| b.mean_cm.total_cmp(&a.mean_cm));
    Ok(Report {
        frames,
        channels: reference.channels,
        fps: reference.fps,
        bytes,
        ratio_f32: samples * 4.0 / bytes as f64,
        def_sum_cm,
        mean_joint_cm: def_sum_cm / joints.len() as f64,
        moving_joint_cm,
        max_point_cm,
        max_joint_cm: frame_max_cm.iter().copied().fold(0.0, f64::max),
        rms_deg,
        psnr_db,
        worst_joints: joints,
        frame_max_cm,
    })
}

fn check(
    what: &'static str,
    found: usize,
    unit: &'static str,
    expected: usize,
    other: &'static str,
) -> Result<(), CompareError> {
    if found == expected {
        return Ok(());
    }
    Err(CompareError::Shape { what, found, unit, expected, other })
}

/// Root mean square in degrees and PSNR in dB over the rotation channels.
fn rotation_error(skeleton: &Skeleton, reference: &Motion, decoded: &Motion) -> (f64, Option<f64>) {
    let mut unwrapped = reference.clone();
    unwrapped.unwrap_angles(skeleton);
    let frames = reference.frames() as f64;
    let (mut channels, mut mse, mut peak) = (0.0, 0.0, 0.0);
    let rotations = skeleton.rotation_channels();
    for channel in (0..reference.channels).filter(|&channel| rotations[channel]) {
        let column = |motion: &Motion| motion.iter().map(|pose| pose[channel]).collect::<Vec<f64>>();
        let pairs = column(reference).into_iter().zip(column(decoded));
        mse += pairs.map(|(a, b)| angles::wrap(a - b).powi(2)).sum::<f64>() / frames;
        let values = column(&unwrapped);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        peak += (high - low).powi(2);
        channels += 1.0;
    }
    let rms = if channels > 0.0 { (mse / channels).sqrt() } else { 0.0 };
    (rms, (mse > 0.0 && peak > 0.0).then(|| 10.0 * (peak / mse).log10()))
}

/// A reference motion with the positions of its joints, for an encoder that tries many variants.
#[derive(Clone, Debug)]
pub struct Evaluator {
    kinematics: Kinematics,
    /// Row-major: frames × channels.
    samples: Vec<f64>,
    /// Row-major: frames × joints.
    reference: Vec<[f64; 3]>,
    /// Whether each joint moves in each frame, as `reference` has them.
    moves: Vec<bool>,
}

impl Evaluator {
    /// Computes the reference's joint positions.
    ///
    /// # Errors
    /// A reference without frames, or with another number of channels than the skeleton.
    pub fn new(skeleton: &Skeleton, reference: &Motion) -> Result<Self, CompareError> {
        check("reference", reference.channels, "channels", skeleton.channels.len(), "skeleton")?;
        if reference.frames() == 0 {
            return Err(CompareError::Empty);
        }
        let mut kinematics = Kinematics::new(skeleton);
        let positions = kinematics.all_positions(reference);
        let moves = moves(&positions, kinematics.joints(), reference.fps);
        Ok(Self { kinematics, samples: reference.samples.clone(), reference: positions, moves })
    }

    /// Number of joints, the root included.
    pub fn joints(&self) -> usize {
        self.kinematics.joints()
    }

    /// Distance between reference and decoded joints in cm, averaged over joints and frames: the report's
    /// `mean_joint_cm`. Costs forward kinematics of the decoded frames and allocates nothing that grows with
    /// them.
    ///
    /// # Panics
    /// If `decoded` has not as many values (frames × channels, row-major) as the reference.
    pub fn mean_joint_cm(&self, decoded: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.distances(decoded, |_, _, cm| sum += cm);
        sum / self.reference.len() as f64
    }

    /// All errors of a decoded motion. Costs forward kinematics of the decoded frames twice and of the reference once.
    ///
    /// # Panics
    /// If `decoded` has not as many values (frames × channels, row-major) as the reference.
    pub fn errors(&self, decoded: &[f64]) -> Errors {
        let joints = self.kinematics.joints();
        let (mut all, mut moving) = (0.0, 0.0);
        self.distances(decoded, |frame, joint, cm| {
            all += cm;
            moving += if self.moves[frame * joints + joint] { cm } else { 0.0 };
        });
        let mean_joint_cm = all / self.reference.len() as f64;
        let count = self.moves.iter().filter(|&&moves| moves).count();
        let moving_joint_cm = if count > 0 { moving / count as f64 } else { mean_joint_cm };
        Errors { mean_joint_cm, moving_joint_cm, max_point_cm: self.max_point_cm(decoded) }
    }

    /// [`Errors::max_point_cm`].
    fn max_point_cm(&self, decoded: &[f64]) -> f64 {
        let (joints, channels) = (self.kinematics.joints(), self.kinematics.channels());
        let (mut one, mut other) = (self.kinematics.clone(), self.kinematics.clone());
        let mut positions = vec![[0.0; 3]; joints];
        let mut greatest = 0.0_f64;
        let poses = self.samples.chunks_exact(channels).zip(decoded.chunks_exact(channels));
        for ((recorded, pose), reference) in poses.zip(self.reference.chunks_exact(joints)) {
            // The reference's positions are known; its axes are not kept, which would take three times their room.
            one.positions(recorded, &mut positions);
            other.positions(pose, &mut positions);
            for (joint, (&from, &to)) in reference.iter().zip(&positions).enumerate() {
                let points = one.points_off(joint, from, POINTS_CM).into_iter();
                for (a, b) in points.zip(other.points_off(joint, to, POINTS_CM)) {
                    greatest = greatest.max(distance(&a, &b));
                }
            }
        }
        greatest
    }

    /// Tells `visit` the frame, the joint and the distance between its two positions in cm, for all of them.
    ///
    /// # Panics
    /// If `decoded` has not as many values (frames × channels, row-major) as the reference.
    pub fn distances(&self, decoded: &[f64], mut visit: impl FnMut(usize, usize, f64)) {
        let (joints, channels) = (self.kinematics.joints(), self.kinematics.channels());
        assert_eq!(decoded.len() / channels, self.reference.len() / joints, "frames to compare");
        let mut kinematics = self.kinematics.clone();
        let mut positions = vec![[0.0; 3]; joints];
        let poses = decoded.chunks_exact(channels).zip(self.reference.chunks_exact(joints));
        for (frame, (pose, reference)) in poses.enumerate() {
            kinematics.positions(pose, &mut positions);
            for (joint, (a, b)) in reference.iter().zip(&positions).enumerate() {
                visit(frame, joint, distance(a, b));
            }
        }
    }
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Whether each joint moves in each frame ([`MOVES_CM`]), row-major as `positions` has them.
fn moves(positions: &[[f64; 3]], joints: usize, fps: f64) -> Vec<bool> {
    let apart = joints * ((MOVES_SECONDS * fps).round() as usize).max(1);
    let far = |one: usize, other: usize| distance(&positions[one], &positions[other]) > MOVES_CM;
    let moves = |at: usize| {
        at.checked_sub(apart).is_some_and(|before| far(before, at))
            || (at + apart < positions.len() && far(at, at + apart))
    };
    (0..positions.len()).map(moves).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::sample;

    fn changed(channel: &str, by: impl Fn(usize) -> f64) -> (Clip, Motion) {
        let clip = sample::clip();
        let mut motion = clip.motion.clone();
        let channel = clip.skeleton.channel(channel).expect("a channel of the puppet");
        for (frame, pose) in motion.samples.chunks_exact_mut(motion.channels).enumerate() {
            pose[channel] += by(frame);
        }
        (clip, motion)
    }

    fn report(channel: &str, by: impl Fn(usize) -> f64) -> Report {
        let (clip, motion) = changed(channel, by);
        compare(&clip.skeleton, &clip.motion, &motion, 1000).expect("motions of one shape")
    }

    fn assert_near(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{a}, expected {b}");
    }

    #[test]
    fn a_shifted_root_shifts_all_joints() {
        // 2 cm in all frames, and 5 in one.
        let report = report("root.tx", |frame| if frame == 17 { -5.0 } else { 2.0 });
        let mean = (479.0 * 2.0 + 5.0) / 480.0;
        assert_near(report.mean_joint_cm, mean);
        assert_near(report.def_sum_cm, 19.0 * mean);
        assert_near(report.max_joint_cm, 5.0);
        assert_near(report.frame_max_cm[17], 5.0);
        assert_near(report.frame_max_cm[18], 2.0);
        assert_eq!((report.rms_deg, report.psnr_db), (0.0, None));
        assert_eq!((report.frames, report.channels, report.fps, report.bytes), (480, 31, 60.0, 1000));
        assert_near(report.ratio_f32, 480.0 * 31.0 * 4.0 / 1000.0);
    }

    #[test]
    fn a_turned_elbow_moves_what_hangs_on_it() {
        let report = report("lradius.rx", |_| 1.0);
        // The elbow's axis is tilted by 10 degrees against the plane across the forearm.
        let arc = 2.0 * 0.5_f64.to_radians().sin() * 10_f64.to_radians().cos();
        let worst: Vec<(&str, f64)> =
            report.worst_joints.iter().map(|joint| (joint.name.as_str(), joint.mean_cm)).collect();
        assert_eq!((worst[0].0, worst[1].0), ("lhand", "lradius"));
        assert_near(worst[1].1, 9.0 * arc);
        assert!(worst[0].1 > worst[1].1 && worst[0].1 <= 13.0 * arc);
        assert!(worst[2].1 < 1e-12);
        // One of 28 rotation channels (31 less the root's 3 translations) is off by 1 degree.
        assert_near(report.rms_deg, (1.0_f64 / 28.0).sqrt());
    }

    #[test]
    fn peak_signal_to_noise_ratio_is_of_all_rotations_together() {
        let (clip, _) = changed("root.tx", |_| 0.0);
        let ranges =
            clip.skeleton.rotation_channels().into_iter().enumerate().filter(|(_, rotation)| *rotation);
        let squares: f64 = ranges
            .map(|(channel, _)| {
                let mut column: Vec<f64> = clip.motion.iter().map(|pose| pose[channel]).collect();
                column.sort_by(f64::total_cmp);
                (column[479] - column[0]).powi(2)
            })
            .sum();
        let report = report("head.ry", |frame| if frame % 2 == 0 { 0.5 } else { -0.5 });
        assert_near(report.psnr_db.expect("an error"), 10.0 * (squares / 0.25).log10());
    }

    #[test]
    fn a_rest_does_not_hide_what_moves() {
        // The puppet stands for 480 frames but for an elbow that bends for half a second; the decoded one never does.
        let (clip, _) = changed("root.tx", |_| 0.0);
        let elbow = clip.skeleton.channel("lradius.rx").expect("a channel of the puppet");
        let still = Motion { samples: clip.motion.frame(0).repeat(480), ..clip.motion };
        let mut moved = still.clone();
        for (frame, pose) in moved.samples.chunks_exact_mut(moved.channels).enumerate() {
            pose[elbow] += if (200..230).contains(&frame) { 4.0 * (frame - 200) as f64 } else { 0.0 };
        }
        let report = compare(&clip.skeleton, &moved, &still, 1).expect("motions of one shape");
        // The forearm's two joints, in the 29 frames that differ and 6 before and after them, of 19 joints in 480 frames.
        let hidden = (480.0 * 19.0) / (2.0 * (29.0 + 12.0));
        assert_near(report.moving_joint_cm / report.mean_joint_cm, hidden);
        // What is still everywhere has one average.
        let shifted =
            Motion { samples: still.samples.iter().map(|value| value + 1.0).collect(), ..still.clone() };
        let report = compare(&clip.skeleton, &still, &shifted, 1).expect("motions of one shape");
        assert_near(report.moving_joint_cm, report.mean_joint_cm);
    }

    #[test]
    fn points_off_a_bone_show_that_it_turns_about_itself() {
        // A head's end is nearly on the axis about which it turns; a point 3 cm beside it is not.
        let (clip, _) = changed("root.tx", |_| 0.0);
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).expect("a motion of the skeleton");
        let (_, turned) = changed("head.ry", |frame| if frame == 100 { 20.0 } else { 0.0 });
        let errors = evaluator.errors(&turned.samples);
        assert!(errors.mean_joint_cm < 1e-4, "{errors:?}");
        let chord = 2.0 * 3.0 * 10_f64.to_radians().sin();
        assert!((errors.max_point_cm / chord - 1.0).abs() < 0.01, "{errors:?}");
        let (_, shifted) = changed("root.tx", |frame| if frame == 17 { 2.0 } else { 1.0 });
        assert_near(evaluator.errors(&shifted.samples).max_point_cm, 2.0);
    }

    #[test]
    fn whole_turns_are_no_error() {
        let report = report("root.ry", |frame| 360.0 * (frame % 3) as f64);
        assert!(report.rms_deg < 1e-9 && report.max_joint_cm < 1e-9, "{report:?}");
    }

    #[test]
    fn evaluator_gives_the_same_mean() {
        let (clip, motion) = changed("spine.rx", |frame| (frame % 7) as f64);
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).expect("a motion of the skeleton");
        let report = compare(&clip.skeleton, &clip.motion, &motion, 1).expect("motions of one shape");
        assert_near(evaluator.mean_joint_cm(&motion.samples), report.mean_joint_cm);
        assert_eq!(evaluator.joints(), 19);
    }

    #[test]
    fn shapes_must_match() {
        let clip = sample::clip();
        let mut short = clip.motion.clone();
        short.samples.truncate(479 * 31);
        let error = compare(&clip.skeleton, &clip.motion, &short, 1).expect_err("a frame less");
        assert_eq!(error.to_string(), "the decoded motion has 479 frames, expected 480 as in the reference");
        let narrow = Motion { channels: 30, ..clip.motion.clone() };
        let error = compare(&clip.skeleton, &narrow, &clip.motion, 1).expect_err("a channel less");
        assert_eq!(error.to_string(), "the reference has 30 channels, expected 31 as in the skeleton");
        let error = compare(&clip.skeleton, &clip.motion, &narrow, 1).expect_err("a channel less");
        assert_eq!(error.to_string(), "the decoded motion has 30 channels, expected 31 as in the reference");
        let empty = Motion { samples: Vec::new(), ..clip.motion };
        assert_eq!(compare(&clip.skeleton, &empty, &empty, 1), Err(CompareError::Empty));
    }

    #[test]
    fn json_has_the_keys_that_the_command_promises() {
        let json = serde_json::to_value(report("root.tx", |_| 0.0)).expect("a report");
        for key in
            ["frames", "channels", "fps", "bytes", "ratio_f32", "def_sum_cm", "mean_joint_cm", "max_joint_cm"]
        {
            assert!(json[key].is_number(), "{key}");
        }
        assert!(json["rms_deg"].is_number() && json["psnr_db"].is_null());
        assert_eq!(json["worst_joints"].as_array().map(Vec::len), Some(19));
    }
}
