//! A motion at another rate.
//!
//! A value between two frames is linear between them, after the rotations of both were written alike: whole turns are
//! undone, and where all three angles of a joint jump while its rotation does not (an Euler flip), the later frame's are
//! replaced by the other triple of the same rotation. Between frames of 10 ms or so a straight line between two near
//! triples and the shortest arc on the sphere are the same within hundredths of a degree. Where the new rate is a whole
//! fraction of the old, frames are taken as they are.
//!
//! No filter goes before: what is faster than half the new rate comes back as a slower movement, as where motion is
//! recorded at that rate. Recorded bodies have little there.

use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// The motion at `fps` frames per second, from its first frame on, to its last frame or just before.
///
/// # Panics
/// If the rate is not above 0, or the skeleton has another number of channels than the motion.
pub fn resample(skeleton: &Skeleton, motion: &Motion, fps: f64) -> Motion {
    assert!(fps > 0.0, "a rate of {fps}");
    let mut motion = motion.clone();
    motion.unflip(skeleton);
    let last = motion.frames().saturating_sub(1);
    let ratio = motion.fps / fps;
    let frames = (last as f64 / ratio + 1e-6).floor() as usize + 1;
    let mut samples = Vec::with_capacity(frames * motion.channels);
    for frame in 0..frames {
        let at = frame as f64 * ratio;
        let before = (at + 1e-6).floor();
        let part = (at - before).max(0.0);
        let (from, to) = (motion.frame(before as usize), motion.frame((before as usize + 1).min(last)));
        samples.extend(from.iter().zip(to).map(|(from, to)| from + part * (to - from)));
    }
    Motion { fps, channels: motion.channels, samples }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::import::bvh;
    use crate::kinematics::Kinematics;
    use crate::sample;

    #[test]
    fn a_fraction_of_the_rate_takes_frames_as_they_are() {
        let clip = sample::clip();
        let third = resample(&clip.skeleton, &clip.motion, 20.0);
        assert_eq!((third.frames(), third.fps), (160, 20.0));
        for frame in 0..third.frames() {
            assert_eq!(third.frame(frame), clip.motion.frame(3 * frame));
        }
    }

    #[test]
    fn other_rates_are_between_frames() {
        let clip = sample::clip();
        let slower = resample(&clip.skeleton, &clip.motion, 40.0);
        let faster = resample(&clip.skeleton, &clip.motion, 120.0);
        assert_eq!((slower.frames(), faster.frames()), (320, 959));
        for channel in 0..clip.motion.channels {
            let [from, to] = [301, 302].map(|frame| clip.motion.frame(frame)[channel]);
            assert!((slower.frame(201)[channel] - f64::midpoint(from, to)).abs() < 1e-9);
            assert!((faster.frame(603)[channel] - f64::midpoint(from, to)).abs() < 1e-9);
        }
    }

    #[test]
    fn between_two_ways_to_write_a_rotation_nothing_turns() {
        let text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 1 \
            2 3\n}\n}\nMOTION\nFrames: 4\nFrame Time: 0.1\n10 80 -170\n12 84 188\n194 92 4\n196 88 5\n";
        let Clip { skeleton, motion } = bvh::parse(text.as_bytes(), "x.bvh", 1.0, None).expect("a clip").clip;
        let faster = resample(&skeleton, &motion, 40.0);
        let mut kinematics = Kinematics::new(&skeleton);
        // In truth it turns by less than 5 degrees from frame to frame, so by less than 1.3 from new frame to new frame,
        // which moves the end by less than 0.1. Through the flip it would go all the way round.
        let at = kinematics.all_positions(&faster);
        let ends: Vec<[f64; 3]> = at.into_iter().skip(1).step_by(2).collect();
        for (frame, pair) in ends.windows(2).enumerate() {
            let step: f64 = (0..3).map(|k| (pair[1][k] - pair[0][k]).powi(2)).sum::<f64>().sqrt();
            assert!(step < 0.1, "frame {frame}: {step}");
        }
        // At the frames that there were, the pose is what it was.
        let original = kinematics.all_positions(&motion);
        for frame in 0..4 {
            let difference = (0..3).map(|k| (original[2 * frame + 1][k] - ends[4 * frame][k]).abs());
            assert!(difference.fold(0.0, f64::max) < 1e-9, "frame {frame}");
        }
    }
}
