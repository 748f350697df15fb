//! What the crate was built without is refused by name, and all else is decoded: for any set of features.
//!
//! `cargo test -p decoder-core --test linked --no-default-features --features dpcm,huffman`. The workspace's test
//! `features` runs this for each feature alone, for none and for all.
#![allow(clippy::unwrap_used)]

use decoder_core::mclip::{Clip, CodecId, EntropyId, MAGIC, Memory, State};
use decoder_core::{Error, Feature, I16F16, Limits};
use sha2::{Digest, Sha256};
use std::fs;
use std::path::Path;

/// Features by name, and whether this test was built with them: a row of a list has one, and one for each of its parts.
macro_rules! features {
    ($($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];)*) => {
        &[$(($name, cfg!(feature = $name)), $(($part, cfg!(feature = $part)),)*)*]
    };
}

macro_rules! features_of_codecs {
    (scalar { $($scalar:tt)* } other { $($other:tt)* }) => {
        features! { $($scalar)* $($other)* }
    };
}

const FEATURES: [&[(&str, bool)]; 2] =
    [decoder_core::for_each_codec!(features_of_codecs), decoder_core::for_each_stage!(features)];

fn is_linked(feature: Feature) -> bool {
    FEATURES.concat().iter().any(|&(name, linked)| name == feature.name() && linked)
}

/// All features of the lists.
fn listed() -> Vec<Feature> {
    let codecs = CodecId::ALL.into_iter().flat_map(|codec| {
        let parts = (0..codec.parts().len() as u8).map(move |part| Feature::Part { codec, part });
        core::iter::once(Feature::Codec(codec)).chain(parts)
    });
    codecs.chain(EntropyId::ALL.map(Feature::Entropy)).collect()
}

/// Which codec, entropy stage and parameters a header has: read here without the decoder, which may refuse them.
fn parts(bytes: &[u8]) -> (CodecId, EntropyId, &[u8]) {
    let mut at = 12;
    // Rate, frames, channels, block, memory, delay.
    for _ in 0..7 {
        while bytes[at] >= 128 {
            at += 1;
        }
        at += 1;
    }
    let codec = CodecId::from_id(bytes[at]).unwrap();
    let entropy = EntropyId::from_id(bytes[at + 1]).unwrap();
    let (length, start) = match bytes[at + 2] {
        low @ 128.. => (usize::from(low & 127) + (usize::from(bytes[at + 3]) << 7), at + 4),
        length => (length.into(), at + 3),
    };
    (codec, entropy, &bytes[start..start + length])
}

/// The features that a clip needs, in the order in which they are looked at.
fn needed(codec: CodecId, entropy: EntropyId, parameters: &[u8]) -> Vec<Feature> {
    let mut needed = vec![Feature::Codec(codec)];
    if codec == CodecId::Adpcm {
        // Sixteen multipliers, the lowest and the highest step, window and period.
        let (steps, rest) = parameters.split_at(18);
        let adapts = steps.iter().take(17).any(|&byte| byte != 0) || steps[17] < 199;
        let parts = [adapts, rest[0] > 0].into_iter().zip(0..).filter(|(has, _)| *has);
        needed.extend(parts.map(|(_, part)| Feature::Part { codec, part }));
    }
    needed.push(Feature::Entropy(entropy));
    needed
}

/// SHA-256 of all frames' words.
fn decoded(clip: &Clip<'_>) -> String {
    let needs = clip.header().needs();
    let (mut pose, mut states) = (vec![I16F16::ZERO; needs.channels], vec![State::EMPTY; needs.channels]);
    let (mut words, mut halves) = (vec![0; needs.words], vec![0; needs.halves]);
    let memory = Memory { pose: &mut pose, states: &mut states, words: &mut words, halves: &mut halves };
    let mut decoder = clip.decoder(memory).unwrap();
    let mut sha = Sha256::new();
    while let Some(pose) = decoder.next_frame().unwrap() {
        pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
    }
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_clip_is_decoded_or_refused_by_the_name_of_what_is_not_linked() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors/v1");
    let sums = fs::read_to_string(folder.join("SHA256SUMS.mclip")).unwrap();
    let (mut played, mut refused) = (0, 0);
    for (sha256, name) in sums.lines().filter_map(|line| line.split_once("  ")) {
        let bytes = fs::read(folder.join(name)).unwrap();
        assert!(bytes.starts_with(&MAGIC));
        let (codec, entropy, parameters) = parts(&bytes);
        let missing = needed(codec, entropy, parameters).into_iter().find(|&feature| !is_linked(feature));
        match (Clip::parse(&bytes, Limits::MAX), missing) {
            (Ok(clip), None) => {
                assert_eq!(decoded(&clip), sha256, "{name}");
                played += 1;
            }
            (Err(Error::NotLinked { feature }), Some(missing)) => {
                assert_eq!(feature, missing, "{name}");
                refused += 1;
            }
            (found, missing) => panic!("{name}: {found:?}, missing is {missing:?}"),
        }
    }
    println!("{played} decoded, {refused} refused");
    assert!(played + refused > 20, "{played} {refused}");
    // Where a codec and a stage are linked, something is decoded: the vectors have each of both.
    let all = FEATURES.concat().iter().all(|&(_, linked)| linked);
    assert_eq!(refused == 0, all, "{refused} of {} refused", played + refused);
}

#[test]
fn the_features_here_are_those_of_the_lists() {
    let listed = listed();
    assert_eq!(
        listed.iter().map(|feature| feature.name()).collect::<Vec<_>>(),
        FEATURES.concat().iter().map(|&(name, _)| name).collect::<Vec<_>>()
    );
    for feature in listed {
        match feature {
            Feature::Codec(codec) => assert_eq!(codec.is_linked(), is_linked(feature), "{feature:?}"),
            Feature::Entropy(stage) => assert_eq!(stage.is_linked(), is_linked(feature), "{feature:?}"),
            Feature::Part { codec, .. } => assert!(!is_linked(feature) || codec.is_linked(), "{feature:?}"),
        }
    }
}
