//! What the crate was built without is refused by name, and all else is played: for any set of features.
//!
//! `cargo test -p decoder-core --test linked --no-default-features --features dpcm,huffman`

use decoder_core::mclip::{Adpcm, Clip, Codec, CodecId, EntropyId, MAGIC};
use decoder_core::{Error, Feature, Limits};
use std::fs;
use std::path::Path;

/// The features that a vector needs, in the order in which they are looked at.
fn needed(codec: &Codec<'_>, entropy: EntropyId) -> Vec<(Feature, bool)> {
    let mut needed = match codec {
        Codec::Pcm => vec![(Feature::Pcm, cfg!(feature = "pcm"))],
        Codec::MuLaw(_) => vec![(Feature::MuLaw, cfg!(feature = "mulaw"))],
        Codec::Dpcm { .. } => vec![(Feature::Dpcm, cfg!(feature = "dpcm"))],
        Codec::Qmd(_) => vec![(Feature::Lookup, cfg!(feature = "lookup"))],
        Codec::Adpcm(Adpcm { quantiser, predictor }) => {
            let step = (Feature::AdaptiveStep, cfg!(feature = "adaptive-step"));
            let predicts = (Feature::AdaptivePredictor, cfg!(feature = "adaptive-predictor"));
            let parts = [(step, quantiser.adapts()), (predicts, predictor.is_some())];
            parts.into_iter().filter(|&(_, has)| has).map(|(part, _)| part).collect()
        }
    };
    needed.push(match entropy {
        EntropyId::FixedWidth => (Feature::FixedWidth, cfg!(feature = "fixed-width")),
        EntropyId::Huffman => (Feature::Huffman, cfg!(feature = "huffman")),
        EntropyId::AdaptiveHuffman => (Feature::AdaptiveHuffman, cfg!(feature = "adaptive-huffman")),
    });
    needed
}

/// Where in a header codec, entropy stage and parameters are: read here without the decoder, which may refuse them.
fn parts(bytes: &[u8]) -> (CodecId, EntropyId, &[u8]) {
    let mut at = 12;
    // Rate, frames, channels, block, memory, delay.
    for _ in 0..7 {
        while bytes[at] >= 128 {
            at += 1;
        }
        at += 1;
    }
    let (codec, entropy) = (CodecId::ALL[usize::from(bytes[at])], EntropyId::ALL[usize::from(bytes[at + 1])]);
    let (length, start) = match bytes[at + 2] {
        low @ 128.. => (usize::from(low & 127) + (usize::from(bytes[at + 3]) << 7), at + 4),
        length => (length.into(), at + 3),
    };
    (codec, entropy, &bytes[start..start + length])
}

#[test]
fn a_clip_that_needs_what_is_not_linked_is_refused_by_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors/v1");
    let mut vectors = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let bytes = fs::read(&path).unwrap();
        if !bytes.starts_with(&MAGIC) {
            continue;
        }
        let (codec, entropy, parameters) = parts(&bytes);
        let codec = Codec::read(codec, parameters, 0).unwrap();
        let missing = needed(&codec, entropy).into_iter().find(|&(_, linked)| !linked);
        let expected = missing.map(|(feature, _)| Error::NotLinked { feature });
        assert_eq!(Clip::parse(&bytes, Limits::MAX).err(), expected, "{}", path.display());
        vectors += 1;
    }
    assert!(vectors > 20, "{vectors}");
}
