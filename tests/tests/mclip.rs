//! mclip: the same frames as a reference decoder that was written in Python from docs/FORMAT.md alone, and damage.
#![allow(clippy::unwrap_used)]

use bunraku_fuzz::Random;
use bunraku_fuzz::mclip::repair;
use bunraku_tests::mclip::{LIST, MCLIP_LIMITS, all, sha256_in_place, sha256_of_stream};
use bunraku_tests::{skip, vectors, workspace};
use decoder_core::mclip::{BLOCK_HEADER_BYTES, Clip, Receiver, Stream};
use decoder_core::{Error, Field};
use encoder::memory::OwnedMemory;
use std::process::Command;

#[test]
fn every_way_to_decode_gives_the_golden_frames() {
    for vector in all() {
        assert_eq!(sha256_in_place(&vector.bytes).as_ref(), Ok(&vector.sha256), "{}", vector.name);
        for size in [1, 3, 64, 1 << 20] {
            let found = sha256_of_stream(&vector.bytes, size);
            assert_eq!(found.as_ref(), Ok(&vector.sha256), "{} in chunks of {size}", vector.name);
        }
    }
}

#[test]
fn the_reference_decoder_gives_the_golden_frames() {
    let mut command = Command::new("python3");
    command.arg(workspace().join("tests/vectors/mclip.py")).arg("hash");
    for vector in all() {
        command.arg(vectors::folder().join(&vector.name));
    }
    let Ok(output) = command.output() else {
        return skip("python3 is not installed");
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let sums = std::fs::read_to_string(vectors::folder().join(LIST)).unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), sums);
}

/// A clip says how long it is, so no part of it is one.
#[test]
fn every_truncation_is_refused() {
    for vector in all() {
        for len in 0..vector.bytes.len() {
            let cut = &vector.bytes[..len];
            assert!(sha256_in_place(cut).is_err(), "{} cut at {len}", vector.name);
            assert!(sha256_of_stream(cut, 61).is_err(), "{} cut at {len}", vector.name);
        }
        let longer = [vector.bytes.as_slice(), &[0]].concat();
        assert!(sha256_in_place(&longer).is_err() && sha256_of_stream(&longer, 61).is_err());
    }
}

#[test]
fn every_single_bit_flip_is_found() {
    for vector in all() {
        let mut bytes = vector.bytes.clone();
        for bit in 0..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(sha256_in_place(&bytes).is_err(), "{} bit {bit}", vector.name);
            assert!(sha256_of_stream(&bytes, 61).is_err(), "{} bit {bit}", vector.name);
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

/// Edits that no checksum betrays: any bytes decode or are refused, in place and streamed alike.
#[test]
fn ten_thousand_edits_with_right_checksums_decode_or_are_refused() {
    let mut random = Random::new(1);
    for vector in all() {
        let (mut decoded, mut refused) = (0, 0);
        let edits = 10_000;
        for _ in 0..edits {
            let mut bytes = vector.bytes.clone();
            for _ in 0..1 + random.below(4) {
                let at = random.below(bytes.len());
                match random.below(4) {
                    0 => bytes[at] = random.below(256) as u8,
                    1 => bytes[at] ^= 1 << random.below(8),
                    2 => bytes[at] = [0, 1, 127, 128, 255][random.below(5)],
                    _ => bytes[at] = bytes[at].wrapping_add(if random.below(2) == 0 { 1 } else { 255 }),
                }
            }
            repair(&mut bytes);
            let found = sha256_in_place(&bytes);
            assert_eq!(found.clone().ok(), sha256_of_stream(&bytes, 61).ok(), "{}", vector.name);
            match found {
                Ok(_) => decoded += 1,
                Err(_) => refused += 1,
            }
        }
        assert!(refused > edits / 50, "{}: {decoded} decoded, {refused} refused", vector.name);
    }
}

/// A vector with several entry points, and where its blocks are.
fn blocks() -> (Vec<u8>, Vec<usize>) {
    let vector = all().into_iter().find(|vector| vector.name == "dpcm-first.mclip").unwrap();
    let clip = Clip::parse(&vector.bytes, MCLIP_LIMITS).unwrap();
    let blocks = clip.blocks().map(|block| block.unwrap().at).collect();
    (vector.bytes, blocks)
}

#[test]
fn a_damaged_block_does_not_harm_the_next_entry_point() {
    let (sound, blocks) = blocks();
    let clip = Clip::parse(&sound, MCLIP_LIMITS).unwrap();
    let mut memory = OwnedMemory::new(clip.header().needs());
    let last = clip.decoder(memory.lend()).unwrap().seek(23).unwrap().unwrap().to_vec();

    let mut damaged = sound.clone();
    damaged[blocks[0] + BLOCK_HEADER_BYTES] ^= 1;
    let clip = Clip::parse(&damaged, MCLIP_LIMITS).unwrap();
    let mut decoder = clip.decoder(memory.lend()).unwrap();
    let error = decoder.next_frame().unwrap_err();
    assert!(matches!(error, Error::Checksum { field: Field::Payload, at, .. } if at == blocks[0]), "{error}");
    assert_eq!(decoder.next_frame(), Err(error), "it is repeated");
    assert_eq!(decoder.seek(23), Ok(Some(last.as_slice())), "frame 18 is an entry point");
    assert_eq!(decoder.seek(3), Err(error));
}

#[test]
fn a_stream_goes_on_at_the_next_entry_point_after_a_loss() {
    let (sound, blocks) = blocks();
    let clip = Clip::parse(&sound, MCLIP_LIMITS).unwrap();
    let mut memory = OwnedMemory::new(clip.header().needs());
    let last = clip.decoder(memory.lend()).unwrap().seek(23).unwrap().unwrap().to_vec();

    let mut buffer = vec![0; sound.len()];
    let mut receiver = Receiver::new(&mut buffer);
    let mut chunk = sound.as_slice();
    assert!(receiver.receive(&mut chunk).unwrap());
    let header = receiver.finish(MCLIP_LIMITS).unwrap();
    let mut block = vec![0; usize::from(header.fields().block_bytes)];
    let mut stream = Stream::new(header, memory.lend(), &mut block).unwrap();
    // The first block is lost on the way; the second one is no entry point.
    let mut rest = &sound[blocks[1]..];
    assert!(stream.next_frame(&mut rest).is_err());
    stream.resume();
    let mut rest = &sound[blocks[1]..];
    let mut numbers = Vec::new();
    let mut found = Vec::new();
    while let Some(pose) = stream.next_frame(&mut rest).unwrap() {
        found = pose.to_vec();
        numbers.push(stream.position() - 1);
    }
    assert_eq!(numbers, (18..24).collect::<Vec<u32>>());
    assert_eq!(found, last);
    stream.finish().unwrap();
}

#[test]
fn memory_that_is_too_small_is_told_with_the_size_that_is_needed() {
    for vector in all() {
        let clip = Clip::parse(&vector.bytes, MCLIP_LIMITS).unwrap();
        let mut needs = clip.header().needs();
        needs.channels -= 1;
        let mut memory = OwnedMemory::new(needs);
        let error = clip.decoder(memory.lend()).unwrap_err();
        let needed = needs.channels + 1;
        let lent = needs.channels;
        assert_eq!(error, Error::OutputTooSmall { field: Field::Pose, needed, lent });
    }
}
