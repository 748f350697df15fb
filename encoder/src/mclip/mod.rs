//! Encoders for `.mclip`: pcm, mulaw, dpcm, adpcm and qmd with each entropy stage.
//!
//! Source: the waveform-coding document, sections 7.2 to 7.6. The bytes are in docs/FORMAT.md, "mclip".
//!
//! Every codec runs the decoder's own loop ([`crate::codec::scalar::simulate`]), so predictions and steps are
//! the decoder's to the last bit, and errors do not add up. Channels get steps in inverse proportion to how far they
//! move the joints, so that an error costs the same wherever it is made.

pub(crate) mod blocks;
mod decode;
pub mod encoder;
pub(crate) mod header;
mod search;

pub use crate::quality::Quality;
pub use decode::decode;
pub use encoder::{Encoder, Encoding};
pub use header::certify;
pub use search::{Bounds, Encoded, Target};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::CodecSettings;
    use crate::codec::adpcm::Adpcm;
    use crate::codec::scalar::contract::ScalarEncode;
    use crate::codec::scalar::simulate;
    use crate::error::EncodeError;
    use crate::memory::OwnedMemory;
    use crate::task::LEVER_CM;
    use decoder_core::Limits;
    use decoder_core::codec::adpcm::Adaptation;
    use decoder_core::mclip::{Clip, CodecId, EntropyId, Receiver, Stream};
    use mocap::metrics::Evaluator;
    use mocap::sample;

    /// Every codec as it is used, and with every entropy stage.
    fn all_encodings() -> Vec<Encoding> {
        let mut all = Vec::new();
        for id in CodecId::ALL {
            let standard = CodecSettings::new(id);
            let mut codecs = vec![standard];
            let curves = CodecSettings::curves(id).into_iter().map(|(_, codec)| codec);
            for codec in curves.chain(standard.cheaper()) {
                if !codecs.contains(&codec) {
                    codecs.push(codec);
                }
            }
            for codec in codecs {
                for entropy in EntropyId::ALL {
                    let entropy = Some(entropy);
                    all.push(Encoding { codec, entropy, entry_frames: 100, block_bytes: 700 });
                }
            }
        }
        all
    }

    /// By the positions of joints alone nobody would see that the head turns.
    #[test]
    fn what_moves_no_joint_is_seen_too() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let yaw = clip.skeleton.channel("head.ry").unwrap();
        let coarse = 0.5;
        let decoded =
            decode(&encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Step(coarse)).unwrap()).unwrap();
        let off = |frame: usize| (decoded.frame(frame)[yaw] - clip.motion.frame(frame)[yaw]).abs();
        // A step, 2.9 degrees; rounding towards zero makes the error larger than half of it.
        let step = (coarse / LEVER_CM).to_degrees();
        assert!((0..decoded.frames()).all(|frame| off(frame) < step), "{step}");
    }

    /// Every frame by way of a stream, in chunks of `size` bytes.
    fn streamed(bytes: &[u8], size: usize) -> Vec<f64> {
        let mut chunks = bytes.chunks(size);
        let mut chunk: &[u8] = &[];
        let mut buffer = vec![0; 8192];
        let mut receiver = Receiver::new(&mut buffer);
        while !receiver.receive(&mut chunk).unwrap() {
            chunk = chunks.next().unwrap();
        }
        let header = receiver.finish(Limits::MAX).unwrap();
        let mut memory = OwnedMemory::new(header.needs());
        let mut block = vec![0; usize::from(header.fields().block_bytes).max(12)];
        let mut stream = Stream::new(header, memory.lend(), &mut block).unwrap();
        let mut samples = Vec::new();
        loop {
            while let Some(pose) = stream.next_frame(&mut chunk).unwrap() {
                samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
            }
            match chunks.next() {
                Some(next) => chunk = next,
                None => break,
            }
        }
        stream.finish().unwrap();
        samples
    }

    #[test]
    fn every_codec_and_entropy_stage_comes_near_and_streams_alike() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for encoding in all_encodings() {
            let mut qualities = vec![Quality::Bits(7)];
            if encoding.has_free_steps() {
                qualities.extend([Quality::Step(0.3), Quality::Even(0.5)]);
            }
            for quality in qualities {
                let encoded = encoder.measured(&encoding, quality, &evaluator).unwrap();
                let off = encoded.errors.mean_joint_cm;
                assert!(off < 0.5, "{encoding:?} {quality:?}: {off} cm");
                let decoded = decode(&encoded.bytes).unwrap();
                assert_eq!((decoded.frames(), decoded.fps), (clip.motion.frames(), clip.motion.fps));
                assert_eq!(streamed(&encoded.bytes, 97), decoded.samples, "{encoding:?}");
            }
        }
    }

    #[test]
    fn seeking_gives_the_frame_that_playing_gives() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for encoding in all_encodings() {
            let bytes = encoder.encode(&encoding, Quality::Bits(5)).unwrap();
            let played = decode(&bytes).unwrap();
            let parsed = Clip::parse(&bytes, Limits::MAX).unwrap();
            assert_eq!(parsed.entry_count(), 5, "480 frames, an entry point every 100");
            let mut memory = OwnedMemory::new(parsed.header().needs());
            let mut decoder = parsed.decoder(memory.lend()).unwrap();
            for frame in [479, 0, 100, 99, 250, 251, 255, 3, 400, 399] {
                let found = decoder.seek(frame).unwrap().unwrap();
                let found: Vec<f64> = found.iter().map(|value| value.to_num()).collect();
                assert_eq!(found, played.frame(frame as usize), "{encoding:?} frame {frame}");
            }
            assert!(decoder.seek(480).unwrap().is_none());
        }
    }

    #[test]
    fn targets_are_met() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for codec in CodecId::ALL.into_iter().filter(|&codec| Encoding::new(codec).has_free_steps()) {
            let encoding = Encoding { entropy: Some(EntropyId::Huffman), ..Encoding::new(codec) };
            let found =
                encoder.encode_to(&encoding, Target::Error(0.1), &evaluator).unwrap().errors.mean_joint_cm;
            assert!((found / 0.1 - 1.0).abs() < 0.03, "{codec:?}: {found} cm");
            let encoded = encoder.encode_to(&encoding, Target::Rate(8_000.0), &evaluator).unwrap();
            let rate = encoder.rate(&encoded.bytes);
            assert!((7_700.0..=8_000.0).contains(&rate), "{codec:?}: {rate} bits a second");
        }
    }

    #[test]
    fn a_channel_is_tried_as_the_clip_will_have_it() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let task = encoder.task(&Encoding::of(Adpcm::default()));
        let allocation = Adpcm::default().allocate_bits(&task, 6).unwrap();
        let coded = simulate::clip(&Adpcm::default(), &task, &allocation).unwrap();
        let (channels, parameters) = (task.motion.columns.len(), &allocation.parameters);
        for (index, (column, &choice)) in task.motion.columns.iter().zip(&allocation.choices).enumerate() {
            let alone = simulate::column(&Adpcm::default(), task.entry_frames, column, parameters, choice, 0);
            let there: Vec<i32> = coded.decoded.iter().skip(index).step_by(channels).copied().collect();
            assert_eq!(alone.unwrap().decoded, there, "channel {index}");
        }
    }

    #[test]
    fn fewer_levels_cost_fewer_bytes_and_more_error() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for codec in CodecId::ALL {
            let encoding = Encoding { entropy: Some(EntropyId::FixedWidth), ..Encoding::new(codec) };
            let clips =
                [3, 5, 7].map(|bits| encoder.measured(&encoding, Quality::Bits(bits), &evaluator).unwrap());
            for pair in clips.windows(2) {
                assert!(pair[0].bytes.len() < pair[1].bytes.len(), "{codec:?}");
                assert!(pair[0].errors.mean_joint_cm > 1.5 * pair[1].errors.mean_joint_cm, "{codec:?}");
            }
        }
    }

    #[test]
    fn settings_that_no_header_can_have_are_refused() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let long = Adpcm { predictor: Some(Adaptation { window: 121, period: 4 }), ..Adpcm::default() };
        let refused = encoder.encode(&Encoding::of(long), Quality::Bits(4)).unwrap_err();
        assert!(matches!(refused, EncodeError::Refused(_)), "{refused}");
        for codec in CodecId::ALL.into_iter().filter(|&codec| !Encoding::new(codec).has_free_steps()) {
            let refused = encoder.encode(&Encoding::new(codec), Quality::Step(0.1)).unwrap_err();
            assert_eq!(refused, EncodeError::NoFreeSteps { codec: codec.name() });
        }
    }
}
