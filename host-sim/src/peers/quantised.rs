//! A motion as int16 frames.

use crate::profile::measure::Expected;
use anyhow::{Result, bail};
use mocap::{Clip, Motion};

/// Bytes of a block before packing, at most; a block has at least one frame.
pub const BLOCK_BYTES: usize = 4096;

/// A motion as int16.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantised {
    channels: usize,
    /// Row-major.
    values: Vec<i16>,
    /// Degrees or centimetres that a step of each channel is.
    steps: Vec<f64>,
}

impl Quantised {
    /// Rounds a motion's values.
    ///
    /// # Errors
    /// A sentence where a value does not fit.
    pub fn new(clip: &Clip) -> Result<Self> {
        let motion = &clip.motion;
        let rotations = clip.skeleton.rotation_channels();
        let far = |rotates: bool| {
            let values = motion.iter().flat_map(|pose| pose.iter().zip(&rotations));
            values.filter(|&(_, &is)| is == rotates).fold(0.0_f64, |far, (value, _)| far.max(value.abs()))
        };
        let limit = f64::from(i16::MAX);
        let finest = [0.01, 0.1, 1.0].into_iter().find(|step| far(false) / step <= limit);
        let Some(translation) = finest.filter(|_| far(true) / 0.01 <= limit) else {
            bail!("the motion reaches {:.0}° and {:.0} cm, which int16 cannot hold", far(true), far(false));
        };
        let steps: Vec<f64> =
            rotations.iter().map(|&rotates| if rotates { 0.01 } else { translation }).collect();
        let values = motion
            .iter()
            .flat_map(|pose| pose.iter().zip(&steps).map(|(value, step)| (value / step).round() as i16))
            .collect();
        Ok(Self { channels: motion.channels, values, steps })
    }

    /// Values of a frame.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Frames in a block.
    pub fn block_frames(&self) -> usize {
        (BLOCK_BYTES / (2 * self.channels)).max(1)
    }

    /// The frames.
    pub fn frames(&self) -> impl Iterator<Item = &[i16]> {
        self.values.chunks_exact(self.channels)
    }

    /// Little-endian bytes of all frames, as they are or as differences, which wrap.
    pub fn bytes(&self, delta: bool) -> Vec<u8> {
        let mut previous = vec![0i16; self.channels];
        let mut bytes = Vec::with_capacity(2 * self.values.len());
        for frame in self.frames() {
            for (value, previous) in frame.iter().zip(&mut previous) {
                let stored = if delta { value.wrapping_sub(*previous) } else { *value };
                bytes.extend(stored.to_le_bytes());
                *previous = *value;
            }
        }
        bytes
    }

    /// What a player gives of it.
    pub(super) fn expected(&self) -> Expected {
        let bytes = |frame: &[i16]| frame.iter().flat_map(|value| value.to_le_bytes()).collect();
        Expected { element: size_of::<i16>(), frames: self.frames().map(bytes).collect() }
    }

    /// The motion that a player has of it.
    pub fn motion(&self, fps: f64) -> Motion {
        let samples = self
            .frames()
            .flat_map(|frame| frame.iter().zip(&self.steps).map(|(&value, step)| f64::from(value) * step));
        Motion { fps, channels: self.channels, samples: samples.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::metrics::Evaluator;

    #[test]
    fn what_is_stored_is_the_motion_to_half_a_step() {
        let clip = mocap::sample::clip();
        let stored = Quantised::new(&clip).unwrap();
        for (found, expected) in stored.motion(60.0).samples.iter().zip(&clip.motion.samples) {
            assert!((found - expected).abs() <= 0.005 + 1e-9, "{found} {expected}");
        }
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        assert!(evaluator.mean_joint_cm(&stored.motion(60.0).samples) < 0.01);
    }

    #[test]
    fn differences_add_up_to_the_frames() {
        let stored = Quantised::new(&mocap::sample::clip()).unwrap();
        let (plain, delta) = (stored.bytes(false), stored.bytes(true));
        let words = |bytes: &[u8]| -> Vec<i16> {
            bytes.as_chunks::<2>().0.iter().map(|&word| i16::from_le_bytes(word)).collect()
        };
        let mut pose = vec![0i16; stored.channels()];
        let mut summed: Vec<i16> = Vec::new();
        for frame in words(&delta).chunks_exact(stored.channels()) {
            pose.iter_mut().zip(frame).for_each(|(value, step)| *value = value.wrapping_add(*step));
            summed.extend(&pose);
        }
        assert_eq!(summed, words(&plain));
    }

    #[test]
    fn a_motion_that_does_not_fit_is_refused() {
        let mut clip = mocap::sample::clip();
        clip.motion.samples[3] = 400.0;
        let found = Quantised::new(&clip);
        let rotates = clip.skeleton.rotation_channels()[3];
        assert_eq!(found.is_err(), rotates);
        clip.motion.samples[0] = 40_000.0;
        assert!(Quantised::new(&clip).unwrap_err().to_string().contains("int16"));
    }
}
