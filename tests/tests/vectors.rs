//! Golden vectors: the same frames as a reference decoder that was written in Python from docs/FORMAT.md alone.
#![allow(clippy::unwrap_used)]

use bunraku_fuzz::Random;
use bunraku_fuzz::mutate::mutate;
use bunraku_tests::{skip, vectors, workspace};
use decoder_core::qmd::Stream;
use decoder_core::{Error, I16F16};
use sha2::{Digest, Sha256};
use std::fs;
use std::process::Command;

/// SHA-256 of a clip's frames, decoded from chunks of `size` bytes.
fn hash_of_stream(bytes: &[u8], size: usize) -> Result<String, Error> {
    let (mut pose, mut table, mut buffer) = (vec![I16F16::ZERO; 300], vec![0; 1 << 16], vec![0; 1200]);
    let mut stream = Stream::new(vectors::LIMITS, &mut pose, &mut table, &mut buffer);
    let mut sha = Sha256::new();
    for mut chunk in bytes.chunks(size) {
        while let Some(pose) = stream.next_frame(&mut chunk)? {
            pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
        }
    }
    stream.finish()?;
    Ok(vectors::hex(sha))
}

/// SHA-256 of the list that `sha256sum *` prints in tests/vectors/v1, sorted by the bytes of the names. The folder is
/// frozen: a file that is changed, added or gone is an error. New vectors go to a folder of their own.
const FROZEN: &str = "6ed7ea26e574c2d00fc6f2f6df8fe23b70bba83e285977afcd708512e04addd5";

#[test]
fn the_frozen_vectors_are_as_they_were() {
    let folder = vectors::folder();
    let mut names: Vec<_> = fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let mut list = Sha256::new();
    for name in names {
        let bytes = fs::read(folder.join(&name)).unwrap();
        list.update(format!("{}  {name}\n", vectors::hex(Sha256::new_with_prefix(bytes))));
    }
    assert_eq!(vectors::hex(list), FROZEN, "{} was changed", folder.display());
}

#[test]
fn every_way_to_decode_gives_the_golden_frames() {
    for vector in vectors::all() {
        for lend in [false, true] {
            assert_eq!(
                vectors::sha256_of_frames(&vector.bytes, lend).as_ref(),
                Ok(&vector.sha256),
                "{}",
                vector.name
            );
        }
        for size in [1, 3, 64, 1 << 20] {
            assert_eq!(hash_of_stream(&vector.bytes, size).as_ref(), Ok(&vector.sha256), "{}", vector.name);
        }
    }
}

#[test]
fn the_reference_decoder_gives_the_golden_frames() {
    let script = workspace().join("tests/vectors/qmd.py");
    let mut command = Command::new("python3");
    command.arg(script).arg("hash");
    for vector in vectors::all() {
        command.arg(vectors::folder().join(&vector.name));
    }
    let Ok(output) = command.output() else {
        return skip("python3 is not installed");
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let sums = fs::read_to_string(vectors::folder().join("SHA256SUMS")).unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), sums);
}

#[test]
fn every_truncation_is_decoded_or_refused() {
    for vector in vectors::all() {
        for len in 0..vector.bytes.len() {
            let cut = &vector.bytes[..len];
            assert_eq!(
                vectors::sha256_of_frames(cut, true).is_ok(),
                hash_of_stream(cut, 61).is_ok(),
                "{} cut at {len}",
                vector.name
            );
        }
    }
}

#[test]
fn every_single_bit_flip_is_decoded_or_refused() {
    for vector in vectors::all() {
        let mut bytes = vector.bytes.clone();
        for bit in 0..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            let whole = vectors::sha256_of_frames(&bytes, bit % 2 == 0);
            // Chunks give the same frames; errors may name a unit where the whole names its field.
            assert_eq!(whole.ok(), hash_of_stream(&bytes, 61).ok(), "{} bit {bit}", vector.name);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[test]
fn ten_thousand_edits_are_decoded_or_refused() {
    let seeds = vectors::all();
    for (number, vector) in seeds.iter().enumerate() {
        let mut random = Random::new(number as u64);
        let mut refused = 0;
        for edit in 0..10_000 {
            let mut bytes = vector.bytes.clone();
            mutate(&mut bytes, &seeds[random.below(seeds.len())].bytes, &mut random);
            let whole = vectors::sha256_of_frames(&bytes, edit % 2 == 0);
            refused += usize::from(whole.is_err());
            assert_eq!(whole.ok(), hash_of_stream(&bytes, 61).ok(), "{} edit {edit}", vector.name);
        }
        assert!((100..9900).contains(&refused), "{}: {refused} refused", vector.name);
    }
}
