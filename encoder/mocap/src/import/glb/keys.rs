//! The keys of an animation, and its values between them.

use super::buffers::numbers;
use super::document::{Animation, Document, Interpolation, Sampler, Wrong};

/// Values of a node over time.
pub(super) struct Keys<const N: usize> {
    pub(super) times: Vec<f64>,
    /// One for each time; for a cubic spline three: tangent before, value, tangent behind.
    values: Vec<[f64; N]>,
    interpolation: Interpolation,
}

impl<const N: usize> Keys<N> {
    fn read(document: &Document, sampler: &Sampler, buffers: &[Vec<u8>]) -> Option<Self> {
        let times = numbers(document, sampler.input, 1, buffers)?;
        let values = numbers(document, sampler.output, N, buffers)?.as_chunks::<N>().0.to_vec();
        let each = if sampler.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let sound = !times.is_empty()
            && values.len() == times.len() * each
            && times.windows(2).all(|pair| pair[0] < pair[1]);
        sound.then_some(Self { times, values, interpolation: sampler.interpolation })
    }

    /// The value at a time; between two keys `between` is asked.
    pub(super) fn at(&self, time: f64, between: impl Fn(&[f64; N], &[f64; N], f64) -> [f64; N]) -> [f64; N] {
        let spline = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| if spline { &self.values[3 * key + 1] } else { &self.values[key] };
        let behind = self.times.partition_point(|&key| key <= time);
        if behind == 0 || behind == self.times.len() {
            return *value(behind.saturating_sub(1));
        }
        let (from, to) = (behind - 1, behind);
        let step = self.times[to] - self.times[from];
        let t = (time - self.times[from]) / step;
        match self.interpolation {
            Interpolation::Step => *value(from),
            Interpolation::Linear => between(value(from), value(to), t),
            Interpolation::CubicSpline => {
                let (out, into) = (&self.values[3 * from + 2], &self.values[3 * to]);
                let (a, b) = (value(from), value(to));
                let (t2, t3) = (t * t, t * t * t);
                std::array::from_fn(|k| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * a[k]
                        + step * (t3 - 2.0 * t2 + t) * out[k]
                        + (3.0 * t2 - 2.0 * t3) * b[k]
                        + step * (t3 - t2) * into[k]
                })
            }
        }
    }
}

/// What moves a node.
#[derive(Default)]
pub(super) struct Track {
    pub(super) translation: Option<Keys<3>>,
    pub(super) rotation: Option<Keys<4>>,
}

/// What moves each node.
pub(super) fn tracks(
    document: &Document,
    animation: &Animation,
    buffers: &[Vec<u8>],
) -> Result<Vec<Track>, Wrong> {
    let mut tracks: Vec<Track> = Vec::new();
    tracks.resize_with(document.nodes.len(), Track::default);
    for (index, channel) in animation.channels.iter().enumerate() {
        let wrong = |what: &str| {
            (format!("{what} in channel {index} of the animation"), "times that ascend and a value for each")
        };
        let Some(node) = channel.target.node else { continue };
        let track = tracks.get_mut(node).ok_or_else(|| wrong("a node that there is not"))?;
        let sampler =
            animation.samplers.get(channel.sampler).ok_or_else(|| wrong("a sampler that there is not"))?;
        match channel.target.path.as_str() {
            "translation" => {
                track.translation =
                    Some(Keys::read(document, sampler, buffers).ok_or_else(|| wrong("other values"))?);
            }
            "rotation" => {
                track.rotation =
                    Some(Keys::read(document, sampler, buffers).ok_or_else(|| wrong("other values"))?);
            }
            _ => {}
        }
    }
    Ok(tracks)
}
