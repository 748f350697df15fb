//! Every codec with every entropy stage, by their lists: a motion comes back, in place and streamed alike.

use bunraku_tests::mclip::{sha256_in_place, sha256_of_stream};
use decoder_core::Limits;
use decoder_core::mclip::{Clip, CodecId, EntropyId};
use encoder::mclip::{Encoder, Encoding, Quality, decode};
use mocap::sample;

/// The mean distance of two motions, in units of a channel.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len() as f64
}

#[test]
fn every_codec_with_every_entropy_stage_gives_the_motion_back() {
    let sample = sample::clip();
    let encoder = Encoder::new(&sample.skeleton, &sample.motion).expect("the sample fits the format");
    for codec in CodecId::ALL {
        let mut prefixed: Option<Vec<f64>> = None;
        for entropy in EntropyId::ALL {
            let name = format!("{}, {}", codec.name(), entropy.name());
            let encoding = Encoding { entropy: Some(entropy), entry_frames: 50, ..Encoding::new(codec) };
            let [coarse, fine] = [3, 7].map(|bits| {
                let bytes = encoder.encode(&encoding, Quality::Bits(bits)).expect("every codec takes bits");
                let clip = Clip::parse(&bytes, Limits::MAX).expect("the encoder writes clips");
                assert_eq!((clip.header().codec().id(), clip.header().entropy()), (codec, entropy));
                assert!(clip.entry_count() > 3, "{name}");
                for size in [1, 61, bytes.len()] {
                    assert_eq!(sha256_of_stream(&bytes, size), sha256_in_place(&bytes), "{name}");
                }
                decode(&bytes).expect("the encoder writes clips").samples
            });
            let distances = [&coarse, &fine].map(|samples| distance(samples, &sample.motion.samples));
            println!("{name}: {:.4} off with 3 bits, {:.4} with 7", distances[0], distances[1]);
            assert!(distances[1] < distances[0] / 2.0 && distances[1] < 0.5, "{name}: {distances:?}");
            // Codes of fixed width may be given to channels at rest, too; those of prefix codes are the same for all stages.
            if entropy != EntropyId::FixedWidth {
                let others = prefixed.get_or_insert_with(|| fine.clone());
                assert!(*others == fine, "{name}: other frames than with another stage");
            }
        }
    }
}
