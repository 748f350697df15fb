//! A motion: frames of channel values at a fixed rate.

/// Frames of channel values, in the order of [`Skeleton::channels`](crate::Skeleton), at a fixed rate.
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
}
