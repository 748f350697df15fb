//! QMD encoders: look-up tables of differences between frames.
//!
//! Source: S. Chattopadhyay, S. M. Bhandarkar, K. Li, "Efficient Compression and Delivery of Stored Motion Data
//! for Avatar Animation in Resource Constrained Devices", VRST 2005, sections 3 to 5. The bytes are in
//! docs/FORMAT.md; `decoder-core` reads them.
//!
//! Two encoders write the same bytes for the same decoder:
//!
//! - [`Method::Faithful`] is the paper's: differences between successive frames of the recording, buckets of
//!   equal frequency, entries averaged by hierarchy level. Its errors add up from frame to frame.
//! - [`Method::ClosedLoop`], the default, takes each difference against what the decoder has by then, so errors
//!   do not add up, and fits the tables to the movement of joints that an error causes.

mod closed_loop;
mod faithful;
pub mod optimize;
mod source;
mod writer;

pub use source::Source;

use decoder_core::qmd::{Clip, MAX_INDEX_BITS, MIN_INDEX_BITS};
use decoder_core::{I16F16, Limits};
use mocap::motion::Motion;

/// The three quality control parameters (paper, section 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub struct Parameters {
    /// Bits of an index (`b`), 8 to 16.
    pub index_bits: u8,
    /// Leading channels whose differences stay floats (`FDF`), 0 to the number of channels.
    pub fixed_channels: u16,
    /// Frames of a segment (`n_d`), at least 1; the last segment may have fewer.
    pub segment_frames: u32,
}

impl Parameters {
    /// The paper's choice for clips of one segment (section 6.1): `b` = 8, `FDF` = 6.
    pub const TABLE_1: Self = Self { index_bits: 8, fixed_channels: 6, segment_frames: u32::MAX };

    /// Bytes of a clip of `frames` frames of `channels` channels (equation 4, and docs/FORMAT.md for the opening).
    pub fn bytes(self, frames: usize, channels: usize) -> usize {
        let layout = self.layout(channels as u16, 0);
        let segments = frames.div_ceil(self.segment_frames as usize);
        segments * (decoder_core::qmd::SEGMENT_HEADER_BYTES + layout.table_bytes())
            + layout.opening_bytes()
            + frames * layout.row_bytes()
    }

    fn layout(self, channels: u16, rate_centihertz: u16) -> decoder_core::qmd::Layout {
        decoder_core::qmd::Layout {
            channels,
            rate_centihertz,
            fixed_channels: self.fixed_channels,
            index_bits: self.index_bits,
        }
    }

    fn check(self, channels: u16) -> Result<(), EncodeError> {
        if !(MIN_INDEX_BITS..=MAX_INDEX_BITS).contains(&self.index_bits) {
            return Err(EncodeError::IndexBits { found: self.index_bits });
        }
        if self.fixed_channels > channels {
            return Err(EncodeError::FixedChannels { found: self.fixed_channels, channels });
        }
        if self.segment_frames == 0 {
            return Err(EncodeError::EmptySegments);
        }
        Ok(())
    }
}

/// How differences are taken and tables are made.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub enum Method {
    /// The paper's encoder.
    Faithful {
        /// `k` of equation 1. `None` is its limit for k → ∞: of the numbers in a bucket only those of its lowest
        /// level count (selective averaging).
        exponent: Option<f64>,
    },
    /// Differences against the decoder's pose, tables that minimise the weighted error.
    ClosedLoop,
}

impl Method {
    /// The paper's encoder with selective averaging.
    pub const FAITHFUL: Self = Self::Faithful { exponent: None };
}

/// Why a motion is not encoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// Index bits that the format does not have.
    #[error("index bits (b) are {found}, expected 8 to 16")]
    IndexBits {
        /// What was asked for.
        found: u8,
    },
    /// More fixed channels than channels.
    #[error("fixed channels (FDF) are {found}, expected 0 to {channels}, the number of channels")]
    FixedChannels {
        /// What was asked for.
        found: u16,
        /// Channels of the motion.
        channels: u16,
    },
    /// Segments without frames.
    #[error("a segment has 0 frames, expected at least 1")]
    EmptySegments,
    /// A motion without frames or channels.
    #[error("the motion has {frames} frames of {channels} channels, expected at least 1 of both")]
    Empty {
        /// Its frames.
        frames: usize,
        /// Its channels.
        channels: usize,
    },
    /// More channels or frames than the format can count.
    #[error("the motion has {found} {what}, the format holds at most {limit}")]
    TooMany {
        /// Channels or frames.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A value outside 16.16 fixed point.
    #[error("frame {frame} of channel {channel} is {value}, outside the range of -32768 to 32767")]
    Range {
        /// Name of the channel.
        channel: String,
        /// The frame, from 0.
        frame: usize,
        /// The value.
        value: f64,
    },
    /// A rate that the format cannot hold.
    #[error("the rate is {found} frames per second, expected 0.01 to 655.35")]
    Rate {
        /// The rate.
        found: f64,
    },
}

/// Encodes a motion. To encode one motion many times, keep a [`Source`].
///
/// # Errors
/// [`EncodeError`] where the parameters or the motion do not fit the format.
pub fn encode(clip: &mocap::Clip, parameters: Parameters, method: Method) -> Result<Vec<u8>, EncodeError> {
    Source::new(&clip.skeleton, &clip.motion)?.encode(parameters, method)
}

/// Decodes a whole clip with the decoder's own code. Values are in degrees and centimetres, angles continuous.
/// Where the clip has no rate, that of the motion is 0.
///
/// # Errors
/// As [`Clip::parse`].
pub fn decode(bytes: &[u8]) -> Result<Motion, decoder_core::Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    let mut pose = vec![I16F16::ZERO; clip.channels()];
    let mut table = vec![0; clip.table_len()];
    let mut decoder = clip.decoder(&mut pose, Some(&mut table))?;
    let mut samples = Vec::with_capacity(clip.frames() as usize * clip.channels());
    while let Some(pose) = decoder.next_frame() {
        samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
    }
    Ok(Motion { fps: f64::from(clip.rate_centihertz()) / 100.0, channels: clip.channels(), samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::metrics::Evaluator;
    use mocap::{Clip as Motions, sample};

    const METHODS: [Method; 3] =
        [Method::FAITHFUL, Method::Faithful { exponent: Some(2.0) }, Method::ClosedLoop];

    fn mean_joint_cm(clip: &Motions, bytes: &[u8]) -> f64 {
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        evaluator.mean_joint_cm(&decode(bytes).unwrap().samples)
    }

    #[test]
    fn every_parameter_gives_a_clip_of_the_papers_size_that_decodes() {
        let clip = sample::clip();
        let (frames, channels) = (clip.motion.frames(), clip.motion.channels);
        let source = Source::new(&clip.skeleton, &clip.motion).unwrap();
        for method in METHODS {
            for fixed_channels in [0, 1, channels as u16 - 1, channels as u16] {
                for index_bits in [8, 9, 12, 16] {
                    for segment_frames in [1, 97, frames as u32, u32::MAX] {
                        if segment_frames == 1 && index_bits > 9 {
                            continue;
                        }
                        let parameters = Parameters { index_bits, fixed_channels, segment_frames };
                        let bytes = source.encode(parameters, method).unwrap();
                        assert_eq!(bytes.len(), parameters.bytes(frames, channels), "{parameters:?}");
                        let decoded = decode(&bytes).unwrap();
                        assert_eq!((decoded.frames(), decoded.fps), (frames, clip.motion.fps));
                    }
                }
            }
        }
    }

    #[test]
    fn without_indices_nothing_is_lost_but_the_last_place() {
        let clip = sample::clip();
        let all_fixed = Parameters { fixed_channels: clip.motion.channels as u16, ..Parameters::TABLE_1 };
        let mut expected = clip.motion.clone();
        expected.unwrap_angles(&clip.skeleton);
        let decoded = decode(&encode(&clip, all_fixed, Method::ClosedLoop).unwrap()).unwrap();
        for (found, expected) in decoded.samples.iter().zip(&expected.samples) {
            // Half a place of 16.16 for the target, as much for the float.
            assert!((found - expected).abs() <= 1.0 / 65536.0, "{found} {expected}");
        }
    }

    #[test]
    fn errors_add_up_in_the_faithful_encoder_only() {
        let clip = sample::clip();
        let faithful = encode(&clip, Parameters::TABLE_1, Method::FAITHFUL).unwrap();
        let ours = encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
        assert_eq!(faithful.len(), ours.len());
        let (faithful, ours) = (mean_joint_cm(&clip, &faithful), mean_joint_cm(&clip, &ours));
        assert!(ours * 20.0 < faithful, "{ours} cm against {faithful} cm");
    }

    #[test]
    fn the_first_frame_is_exact_and_no_later_one_is_off_by_more_than_a_gap_of_the_table() {
        let clip = sample::clip();
        let bytes = encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
        let decoded = decode(&bytes).unwrap();
        let mut expected = clip.motion.clone();
        expected.unwrap_angles(&clip.skeleton);
        for (found, expected) in decoded.frame(0).iter().zip(expected.frame(0)) {
            assert!((found - expected).abs() <= 1.0 / 65536.0);
        }
        let worst = |frame| {
            let pairs = decoded.frame(frame).iter().zip(expected.frame(frame));
            pairs.map(|(found, expected)| (found - expected).abs()).fold(0.0, f64::max)
        };
        let half = decoded.frames() / 2;
        let first: f64 = (0..half).map(worst).fold(0.0, f64::max);
        let second: f64 = (half..decoded.frames()).map(worst).fold(0.0, f64::max);
        assert!(second < 4.0 * first + 0.01, "no drift: {first} then {second}");
    }

    #[test]
    fn angles_that_wrap_are_coded_as_small_steps() {
        let clip = sample::clip();
        let channel = clip.skeleton.rotation_channels().iter().rposition(|&rotates| rotates).unwrap();
        let mut turning = clip.clone();
        for frame in 0..turning.motion.frames() {
            let angle = 3.0 * frame as f64;
            turning.motion.samples[frame * turning.motion.channels + channel] =
                (angle + 180.0) % 360.0 - 180.0;
        }
        let error =
            mean_joint_cm(&turning, &encode(&turning, Parameters::TABLE_1, Method::ClosedLoop).unwrap());
        assert!(error < 0.1, "{error} cm");
    }

    #[test]
    fn what_does_not_fit_the_format_is_refused() {
        let clip = sample::clip();
        let encode_with = |change: fn(&mut Parameters)| {
            let mut parameters = Parameters::TABLE_1;
            change(&mut parameters);
            encode(&clip, parameters, Method::ClosedLoop).unwrap_err().to_string()
        };
        assert_eq!(encode_with(|p| p.index_bits = 17), "index bits (b) are 17, expected 8 to 16");
        assert!(
            encode_with(|p| p.fixed_channels = 999)
                .starts_with("fixed channels (FDF) are 999, expected 0 to")
        );
        assert_eq!(encode_with(|p| p.segment_frames = 0), "a segment has 0 frames, expected at least 1");

        let refused = |change: fn(&mut Motion)| {
            let mut clip = sample::clip();
            change(&mut clip.motion);
            encode(&clip, Parameters::TABLE_1, Method::ClosedLoop).unwrap_err().to_string()
        };
        let far = refused(|motion| motion.samples[motion.channels * 3] = 40_000.0);
        assert!(far.starts_with("frame 3 of channel root.tx is 40000"), "{far}");
        assert!(refused(|motion| motion.fps = 1000.0).contains("1000 frames per second"));
        assert!(refused(|motion| motion.samples.clear()).contains("0 frames"));
    }
}
