//! A motion made ready to be encoded, once for however many parameters.

use crate::error::EncodeError;
use mocap::kinematics;
use mocap::motion::Motion;
use mocap::skeleton::Skeleton;

/// What encoders need of a motion.
#[derive(Clone, Debug)]
pub struct Source {
    pub(crate) channels: usize,
    pub(crate) frames: usize,
    pub(crate) rate_centihertz: u16,
    /// Frames per second as a ratio.
    pub(crate) rate: (u32, u32),
    /// Angles made continuous, in degrees and centimetres, row-major.
    pub(crate) samples: Vec<f64>,
    /// The same in 16.16 fixed point: what a decoder should give.
    pub(crate) targets: Vec<i32>,
    /// Hierarchy level of every channel.
    pub(crate) levels: Vec<u8>,
    /// Squared movement of the joints, in cm², per squared unit of every channel.
    pub(crate) weights: Vec<f64>,
}

impl Source {
    /// Makes angles continuous, and finds how far each channel moves the joints.
    ///
    /// # Errors
    /// [`EncodeError`] where the motion is empty or its size, rate or values do not fit the format.
    pub fn new(skeleton: &Skeleton, motion: &Motion) -> Result<Self, EncodeError> {
        let (frames, channels) = (motion.frames(), motion.channels);
        if frames == 0 || channels == 0 {
            return Err(EncodeError::Empty { frames, channels });
        }
        for (what, found, limit) in
            [("channels", channels, usize::from(u16::MAX)), ("frames", frames, u32::MAX as usize)]
        {
            if found > limit {
                return Err(EncodeError::TooMany { what, found, limit });
            }
        }
        let rate = (motion.fps * 100.0).round();
        if !(1.0..=f64::from(u16::MAX)).contains(&rate) {
            return Err(EncodeError::Rate { found: motion.fps });
        }
        let mut continuous = motion.clone();
        continuous.unwrap_angles(skeleton);
        let mut targets = Vec::with_capacity(continuous.samples.len());
        for (index, &value) in continuous.samples.iter().enumerate() {
            let bits = (value * 65536.0).round();
            if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&bits) {
                let channel = skeleton.channels[index % channels].name.clone();
                return Err(EncodeError::Range { channel, frame: index / channels, value });
            }
            targets.push(bits as i32);
        }
        Ok(Self {
            channels,
            frames,
            rate_centihertz: rate as u16,
            rate: ratio(motion.fps),
            targets,
            levels: skeleton.channel_levels(),
            weights: weights(skeleton, &continuous),
            samples: continuous.samples,
        })
    }

    /// Frames of the motion.
    pub const fn frames(&self) -> usize {
        self.frames
    }

    /// Channels of the motion.
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// The ranges of frames that segments of `segment_frames` cover.
    pub(crate) fn segments(&self, segment_frames: u32) -> impl Iterator<Item = std::ops::Range<usize>> {
        let (frames, length) = (self.frames, segment_frames as usize);
        (0..frames.div_ceil(length)).map(move |index| {
            let start = index * length;
            start..start.saturating_add(length).min(frames)
        })
    }
}

/// Numerator and denominator of a rate from 0.01 to 655.35: the simplest that are within 10⁻¹² of it, by its continued
/// fraction. That is 24000/1001 for the nearest float of it.
fn ratio(fps: f64) -> (u32, u32) {
    let (mut below, mut found) = ((0.0, 1.0), (1.0, 0.0));
    let mut rest = fps;
    loop {
        let whole = rest.floor();
        let next: (f64, f64) = (whole * found.0 + below.0, whole * found.1 + below.1);
        if next.0.max(next.1) > f64::from(u32::MAX) {
            break;
        }
        (below, found) = (found, next);
        rest = 1.0 / (rest - whole);
        if (found.0 / found.1 - fps).abs() <= 1e-12 * fps || !rest.is_finite() {
            break;
        }
    }
    (found.0 as u32, found.1 as u32)
}

/// How much an error counts in every channel. A channel that moves no joint (a BVH's last joint may have no End
/// Site) still counts a little, so that it is coded at all.
fn weights(skeleton: &Skeleton, motion: &Motion) -> Vec<f64> {
    let mut weights = kinematics::sensitivity(skeleton, motion);
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let least = if largest > 0.0 { largest * 1e-6 } else { 1.0 };
    weights.iter_mut().for_each(|weight| *weight = weight.max(least));
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_the_simplest_ratios() {
        for (fps, expected) in [
            (30.0, (30, 1)),
            (120.0, (120, 1)),
            (24_000.0 / 1001.0, (24_000, 1001)),
            (60_000.0 / 1001.0, (60_000, 1001)),
            (12.5, (25, 2)),
            (59.94, (2997, 50)),
            (1.0 / 0.0335, (2000, 67)),
            (1.0 / 30.0, (1, 30)),
            (0.01, (1, 100)),
            (655.35, (13_107, 20)),
        ] {
            assert_eq!(ratio(fps), expected, "{fps}");
        }
        let odd = std::f64::consts::PI;
        let (numerator, denominator) = ratio(odd);
        assert!((f64::from(numerator) / f64::from(denominator) - odd).abs() < 1e-11);
    }
}
