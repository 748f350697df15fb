//! The golden vectors by every way to decode, in the core's own tests: so they run under Miri, as big-endian code too,
//! and against every mutant (docs/TESTING.md).

use crate::common::{Heap, LIMITS, Vector, block_buffer, vectors};
use decoder_core::mclip::{self, EntryPoint, Receiver};
use decoder_core::qmd::{self, MAX_INDEX_BITS};
use decoder_core::{Error, I16F16};
use sha2::{Digest, Sha256};

/// Chunks to stream in.
const CHUNKS: &[usize] = if cfg!(miri) { &[61] } else { &[1, 3, 61, 1 << 20] };

fn add(sha: &mut Sha256, pose: &[I16F16]) {
    pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
}

fn hex(sha: Sha256) -> String {
    sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn qmd_in_place() {
    for Vector { name, bytes, sha256 } in vectors("SHA256SUMS") {
        let clip = qmd::Clip::parse(&bytes, LIMITS).unwrap();
        let mut table = vec![0; clip.table_len()];
        for table in [None, Some(table.as_mut_slice())] {
            let mut pose = vec![I16F16::ZERO; clip.channels()];
            let mut decoder = clip.decoder(&mut pose, table).unwrap();
            for _ in 0..2 {
                let mut sha = Sha256::new();
                while let Some(pose) = decoder.next_frame() {
                    add(&mut sha, pose);
                }
                assert_eq!(hex(sha), sha256, "{name}");
                assert_eq!(decoder.position(), clip.frames());
                decoder.rewind();
                assert_eq!(decoder.position(), 0);
            }
            assert_eq!(decoder.clip().layout(), clip.layout());
        }
        assert_eq!(clip.rate_centihertz().to_le_bytes(), bytes[6..8]);
    }
}

#[test]
fn qmd_streamed() {
    for Vector { name, bytes, sha256 } in vectors("SHA256SUMS") {
        for &size in CHUNKS {
            let (mut pose, mut table, mut buffer) =
                (vec![I16F16::ZERO; 300], vec![0; 1 << MAX_INDEX_BITS], vec![0; 1200]);
            let mut stream = qmd::Stream::new(LIMITS, &mut pose, &mut table, &mut buffer);
            let mut sha = Sha256::new();
            for mut chunk in bytes.chunks(size) {
                while let Some(pose) = stream.next_frame(&mut chunk).unwrap() {
                    add(&mut sha, pose);
                }
            }
            assert_eq!(stream.finish(), Ok(()));
            assert_eq!(stream.layout(), Some(qmd::Clip::parse(&bytes, LIMITS).unwrap().layout()));
            assert_eq!(hex(sha), sha256, "{name} in chunks of {size}");
        }
    }
}

#[test]
fn mclip_in_place() {
    for Vector { name, bytes, sha256 } in vectors("SHA256SUMS.mclip") {
        let clip = mclip::Clip::parse(&bytes, LIMITS).unwrap();
        let mut lent = Heap::new(clip.header().needs());
        let mut decoder = clip.decoder(lent.memory()).unwrap();
        let mut frames = Vec::new();
        for _ in 0..2 {
            let mut sha = Sha256::new();
            frames.clear();
            while let Some(pose) = decoder.next_frame().unwrap() {
                assert_eq!(pose.len(), clip.channels());
                add(&mut sha, pose);
                frames.push(pose.to_vec());
            }
            assert_eq!(hex(sha), sha256, "{name}");
            assert_eq!((decoder.position(), clip.frames() as usize), (clip.frames(), frames.len()));
            decoder.rewind();
            assert_eq!(decoder.position(), 0);
        }
        let mut index = vec![EntryPoint::EMPTY; clip.entry_count() as usize];
        let indexed = clip.with_index(&mut index);
        let mut other = Heap::new(clip.header().needs());
        let mut by_index = indexed.decoder(other.memory()).unwrap();
        // The golden ratio visits the clip in jumps both ways.
        let mut at = 0;
        for _ in 0..24 {
            at = (at + frames.len() * 89 / 144 + 1) % frames.len();
            let before = decoder.position();
            decoder.approach(at as u32).unwrap();
            let near = decoder.position();
            by_index.approach(at as u32).unwrap();
            assert_eq!(by_index.position(), near, "{name} near {at}");
            assert_eq!(by_index.seek(at as u32).unwrap(), Some(frames[at].as_slice()), "{name}: {at}");
            assert!(near <= at as u32, "{name} near {at}: {near}");
            // Where it did not stay it is at an entry point, which decodes by itself, and so does not depend on what was before.
            if near != before {
                let mut other = Heap::new(clip.header().needs());
                let mut fresh = clip.decoder(other.memory()).unwrap();
                fresh.approach(near).unwrap();
                assert_eq!(fresh.position(), near, "{name}: no entry point");
            }
            let found = decoder.seek(at as u32).unwrap().map(<[I16F16]>::to_vec);
            assert_eq!(found.as_ref(), frames.get(at), "{name} seek to {at}");
            assert_eq!(decoder.position(), at as u32 + 1);
            assert_eq!(decoder.seek(clip.frames()), Ok(None));
            assert_eq!(decoder.position(), at as u32 + 1);
        }
    }
}

fn streamed(bytes: &[u8], size: usize) -> Result<String, Error> {
    let mut chunks = bytes.chunks(size);
    let mut chunk: &[u8] = &[];
    let mut buffer = vec![0; bytes.len()];
    let mut receiver = Receiver::new(&mut buffer);
    while !receiver.receive(&mut chunk)? {
        chunk = chunks.next().unwrap();
    }
    let header = receiver.finish(LIMITS)?;
    let mut lent = Heap::new(header.needs());
    let mut block = block_buffer(&header);
    let mut stream = mclip::Stream::new(header, lent.memory(), &mut block)?;
    let mut sha = Sha256::new();
    loop {
        while let Some(pose) = stream.next_frame(&mut chunk)? {
            add(&mut sha, pose);
        }
        match chunks.next() {
            Some(next) => chunk = next,
            None => break,
        }
    }
    assert_eq!(stream.position(), stream.header().frames());
    stream.finish()?;
    Ok(hex(sha))
}

#[test]
fn mclip_streamed() {
    for Vector { name, bytes, sha256 } in vectors("SHA256SUMS.mclip") {
        for &size in CHUNKS {
            assert_eq!(streamed(&bytes, size).as_ref(), Ok(&sha256), "{name} in chunks of {size}");
        }
    }
}

#[test]
fn an_index_has_the_entry_points_of_the_clip() {
    let mut points = 0;
    for Vector { name, bytes, .. } in vectors("SHA256SUMS.mclip") {
        let clip = mclip::Clip::parse(&bytes, LIMITS).unwrap();
        let needed = clip.entry_count() as usize;
        let mut memory = vec![EntryPoint { first_frame: 9, at: 9 }; needed];
        let _ = clip.with_index(&mut memory);
        let blocks = clip.blocks().map(Result::unwrap);
        let entries = blocks.filter(|block| block.header.entry);
        let expected =
            entries.map(|block| EntryPoint { first_frame: block.header.first_frame, at: block.at as u32 });
        assert_eq!(memory, expected.collect::<Vec<_>>(), "{name}");
        // In memory for half of them is every second one.
        let mut fewer = vec![EntryPoint::EMPTY; needed.div_ceil(2)];
        let _ = clip.with_index(&mut fewer);
        assert!(fewer.iter().eq(memory.iter().step_by(2)), "{name}");
        points += needed;
    }
    assert!(points > 40, "{points}");
}
