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
mod encode;
mod faithful;
pub mod optimize;
mod parameters;
mod writer;

pub use encode::{decode, encode};
pub use parameters::{Method, Parameters};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Source;
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

        let refused = |change: fn(&mut mocap::Motion)| {
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
