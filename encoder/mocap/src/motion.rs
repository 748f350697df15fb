//! A motion: frames of channel values at a fixed rate.

use crate::angles;
use crate::skeleton::{Origin, Skeleton};

/// Frames of channel values, in the order of [`Skeleton::channels`](crate::skeleton::Skeleton), at a fixed rate.
///
/// Rotations are in degrees and translations in centimetres, whatever the file's units were. Values are as
/// recorded: [`unwrap_angles`](Motion::unwrap_angles) makes them continuous.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Frames per second.
    pub fps: f64,
    /// Number of channels in a frame, at least 1.
    pub channels: usize,
    /// Row-major samples: frame `i` is `samples[i * channels..][..channels]`.
    pub samples: Vec<f64>,
}

impl Motion {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.samples.len() / self.channels
    }

    /// The values of frame `index`, one per channel.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn frame(&self, index: usize) -> &[f64] {
        &self.samples[index * self.channels..][..self.channels]
    }

    /// All frames in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.samples.chunks_exact(self.channels)
    }

    /// The same frames with these channels alone, in this order.
    ///
    /// # Panics
    /// If there is no such channel, or none is named.
    #[must_use]
    pub fn with_channels(&self, kept: &[usize]) -> Self {
        assert!(!kept.is_empty(), "a motion has a channel");
        let samples = self.iter().flat_map(|frame| kept.iter().map(|&channel| frame[channel])).collect();
        Self { fps: self.fps, channels: kept.len(), samples }
    }

    /// Makes rotations continuous: adds multiples of 360 degrees such that successive samples of a rotation
    /// channel differ by at most 180. The first frame stays as it is, and so do translations. The columns of a
    /// [table](Origin::Table) stay too: they are what joints are told, and a whole turn is another place there.
    ///
    /// # Panics
    /// If the skeleton has another number of channels than the motion.
    pub fn unwrap_angles(&mut self, skeleton: &Skeleton) {
        if skeleton.origin == Origin::Table {
            return;
        }
        for channel in self.rotations(skeleton) {
            let mut turns = 0.0;
            let mut previous = self.samples.get(channel).copied().unwrap_or(0.0);
            for sample in self.samples.iter_mut().skip(channel).step_by(self.channels) {
                // Whole turns are kept apart from the sample, so that rounding does not add up.
                turns -= ((*sample - previous) / 360.0).round();
                previous = *sample;
                *sample += 360.0 * turns;
            }
        }
    }

    /// Makes rotations continuous, as [`unwrap_angles`](Self::unwrap_angles), and through Euler flips too: where the three
    /// angles of a joint are nearer to the previous frame's in the other way to write the same rotation, that is taken.
    /// No pose changes, and the first frame stays as it is.
    ///
    /// # Panics
    /// If the skeleton has another number of channels than the motion.
    pub fn unflip(&mut self, skeleton: &Skeleton) {
        self.unwrap_angles(skeleton);
        for triple in skeleton.joints.iter().filter_map(|joint| joint.euler_triple(skeleton)) {
            let mut previous = triple.map(|channel| self.samples.get(channel).copied().unwrap_or(0.0));
            for row in self.samples.chunks_exact_mut(self.channels) {
                previous = angles::nearest_triple(triple.map(|channel| row[channel]), previous);
                triple.iter().zip(previous).for_each(|(&channel, angle)| row[channel] = angle);
            }
        }
    }

    /// Brings every rotation into (-180, 180] degrees, as AMC files have them.
    ///
    /// # Panics
    /// If the skeleton has another number of channels than the motion.
    pub fn wrap_angles(&mut self, skeleton: &Skeleton) {
        for channel in self.rotations(skeleton) {
            for sample in self.samples.iter_mut().skip(channel).step_by(self.channels) {
                *sample = angles::wrap(*sample);
            }
        }
    }

    fn rotations(&self, skeleton: &Skeleton) -> Vec<usize> {
        assert_eq!(skeleton.channels.len(), self.channels, "channels of the skeleton and of the motion");
        (0..self.channels).filter(|&channel| skeleton.channels[channel].dof.is_rotation()).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::sample;

    #[test]
    fn columns_of_a_table_are_as_they_were() {
        let text = b"time,a,b.rx\n0,170,-170\n0.1,-170,170\n";
        let read = crate::import::csv::parse(text, "x.csv", &crate::import::Options::default()).unwrap();
        let mut motion = read.clip.motion.clone();
        motion.unwrap_angles(&read.clip.skeleton);
        assert_eq!(motion.samples, [170.0, -170.0, -170.0, 170.0]);
    }

    #[test]
    fn unwrapping_makes_rotations_continuous_and_wrapping_takes_it_back() {
        let clip = sample::clip();
        let mut motion = clip.motion.clone();
        let turning = clip.skeleton.channel("root.ry").expect("the sample's root turns");
        for (frame, row) in motion.samples.chunks_exact_mut(motion.channels).enumerate() {
            row[turning] = frame as f64 * 170.0;
        }
        let straight = motion.clone();
        motion.wrap_angles(&clip.skeleton);
        assert_ne!(motion, straight);
        assert!(motion.iter().all(|row| row[turning] > -180.0 && row[turning] <= 180.0));
        let wrapped = motion.clone();
        motion.unwrap_angles(&clip.skeleton);
        assert_eq!(motion, straight);
        motion.wrap_angles(&clip.skeleton);
        assert_eq!(motion, wrapped);
    }

    #[test]
    fn translations_are_not_angles() {
        let clip = sample::clip();
        let along = clip.skeleton.channel("root.tz").expect("the sample walks");
        let mut motion = clip.motion.clone();
        for (frame, row) in motion.samples.chunks_exact_mut(motion.channels).enumerate() {
            row[along] = frame as f64 * 300.0;
        }
        let before = motion.clone();
        motion.wrap_angles(&clip.skeleton);
        motion.unwrap_angles(&clip.skeleton);
        assert_eq!(motion.frame(7)[along], before.frame(7)[along]);
    }
}
