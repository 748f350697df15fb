//! Clips of mclip that were damaged, or are none: where each error is, and how decoding goes on after it.

use crate::common::{Heap, LIMITS, Vector, block_buffer, header_bytes, vectors};
use decoder_core::mclip::{BLOCK_HEADER_BYTES, BlockHeader, Clip, Header, Receiver, Stream};
use decoder_core::{Error, Field, I16F16};

type Frame = Vec<I16F16>;

/// The vectors that are small enough to be damaged in every way.
fn small() -> Vec<Vector> {
    let mut vectors = vectors("SHA256SUMS.mclip");
    vectors.retain(|vector| vector.bytes.len() < if cfg!(miri) { 120 } else { 700 });
    assert!(vectors.len() > 1);
    vectors
}

/// Frames in place, and how they ended.
fn in_place(bytes: &[u8]) -> (Vec<Frame>, Result<(), Error>) {
    let mut frames = Vec::new();
    let end = (|| {
        let clip = Clip::parse(bytes, LIMITS)?;
        let mut lent = Heap::new(clip.header().needs());
        let mut decoder = clip.decoder(lent.memory())?;
        loop {
            match decoder.next_frame() {
                Ok(Some(pose)) => frames.push(pose.to_vec()),
                Ok(None) => return Ok(()),
                Err(error) => {
                    assert_eq!(decoder.next_frame(), Err(error), "it is repeated");
                    return Err(error);
                }
            }
        }
    })();
    (frames, end)
}

/// Frames of a stream of sound header, in chunks, and how they ended.
fn streamed(bytes: &[u8], size: usize) -> (Vec<Frame>, Result<(), Error>) {
    let header = Header::parse(bytes, LIMITS).unwrap();
    let mut lent = Heap::new(header.needs());
    let mut block = block_buffer(&header);
    let mut frames = Vec::new();
    let mut stream = Stream::new(header, lent.memory(), &mut block).unwrap();
    for mut chunk in bytes[header_bytes(bytes)..].chunks(size) {
        loop {
            match stream.next_frame(&mut chunk) {
                Ok(Some(pose)) => frames.push(pose.to_vec()),
                Ok(None) => break,
                Err(error) => {
                    assert_eq!(stream.next_frame(&mut chunk), Err(error), "it is repeated");
                    assert_eq!(stream.finish(), Err(error));
                    return (frames, Err(error));
                }
            }
        }
    }
    (frames, stream.finish())
}

/// A clip in parts: its header, and its blocks with their codes.
fn taken_apart(bytes: &[u8]) -> (Vec<u8>, Vec<(BlockHeader, Vec<u8>)>) {
    let header = Header::parse(bytes, LIMITS).unwrap();
    let mut at = header_bytes(bytes);
    let mut blocks = Vec::new();
    let mut frame = 0;
    while at < bytes.len() {
        let block =
            BlockHeader::read(bytes[at..].first_chunk().unwrap(), at, header.block_bounds(), Some(frame))
                .unwrap();
        let codes = bytes[at + BLOCK_HEADER_BYTES..][..usize::from(block.length)].to_vec();
        at += BLOCK_HEADER_BYTES + codes.len();
        frame += u32::from(block.frames);
        blocks.push((block, codes));
    }
    (bytes[..header_bytes(bytes)].to_vec(), blocks)
}

/// A vector of at least three blocks, of which a later one is an entry point and the second one is none.
fn of_blocks() -> Vec<u8> {
    let found = vectors("SHA256SUMS.mclip").into_iter().find(|Vector { bytes, .. }| {
        let (_, blocks) = taken_apart(bytes);
        blocks.len() > 2 && !blocks[1].0.entry && blocks[2..].iter().any(|(block, _)| block.entry)
    });
    found.unwrap().bytes
}

/// The offset of each block's header.
fn offsets(bytes: &[u8]) -> Vec<usize> {
    let (header, blocks) = taken_apart(bytes);
    let next = |at: &mut usize, (_, codes): &(BlockHeader, Vec<u8>)| {
        let found = *at;
        *at += BLOCK_HEADER_BYTES + codes.len();
        Some(found)
    };
    blocks.iter().scan(header.len(), next).collect()
}

/// The clip with its block `number` changed; its checksum is right.
fn with_block(bytes: &[u8], number: usize, change: impl FnOnce(&mut BlockHeader, &mut Vec<u8>)) -> Vec<u8> {
    let (mut clip, mut blocks) = taken_apart(bytes);
    let (block, codes) = &mut blocks[number];
    change(block, codes);
    *block = BlockHeader::of(codes, block.frames, block.first_frame, block.entry).unwrap();
    for (block, codes) in blocks {
        clip.extend(block.emit());
        clip.extend(codes);
    }
    clip
}

#[test]
fn a_clip_put_together_again_is_the_same() {
    for Vector { name, bytes, .. } in small() {
        assert_eq!(with_block(&bytes, 0, |_, _| {}), bytes, "{name}");
    }
}

#[test]
fn every_truncation_is_an_error_that_counts_right() {
    for Vector { name, bytes, .. } in small() {
        let start = header_bytes(&bytes);
        for len in 0..bytes.len() {
            let cut = &bytes[..len];
            let error = Clip::parse(cut, LIMITS).unwrap_err();
            let Error::Truncated { at, needed, found, .. } = error else { panic!("{name} {len}: {error}") };
            assert!(found < needed && at + found == len, "{name} {len}: {error}");
            if len < start {
                let mut buffer = [0; 1000];
                let mut receiver = Receiver::new(&mut buffer);
                assert_eq!(receiver.receive(&mut &*cut), Ok(false));
                assert!(receiver.finish(LIMITS).is_err());
            } else {
                let Err(Error::Truncated { at, needed, found, .. }) = streamed(cut, 7).1 else {
                    panic!("{name} {len}");
                };
                assert!(found < needed && at <= len - start, "{name} {len}: {at} {needed} {found}");
            }
        }
        let longer = [bytes.as_slice(), &[0]].concat();
        let end = Error::Encoding { field: Field::BlockHeader, at: bytes.len() };
        assert_eq!(Clip::parse(&longer, LIMITS).unwrap_err(), end);
        let end = Error::Encoding { field: Field::BlockHeader, at: bytes.len() - start };
        assert_eq!(streamed(&longer, 7).1, Err(end));
    }
}

#[test]
fn every_flipped_bit_is_found_before_its_block_gives_a_frame() {
    for Vector { name, bytes, .. } in small() {
        let start = header_bytes(&bytes);
        let (sound, _) = in_place(&bytes);
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let (frames, end) = in_place(&flipped);
            assert!(end.is_err() && sound.starts_with(&frames), "{name} bit {bit}");
            if bit < start * 8 {
                assert!(Header::parse(&flipped, LIMITS).is_err());
            } else {
                let (frames, end) = streamed(&flipped, 61);
                assert!(end.is_err() && sound.starts_with(&frames), "{name} bit {bit} streamed");
            }
        }
    }
}

#[test]
fn block_headers_that_no_encoder_writes_are_refused_where_they_are_wrong() {
    let bytes = of_blocks();
    let (offsets, header) = (offsets(&bytes), Header::parse(&bytes, LIMITS).unwrap());
    let (_, blocks) = taken_apart(&bytes);
    let start = header_bytes(&bytes);
    let frames = u32::from(blocks[1].0.frames);
    let first = blocks[1].0.first_frame;
    let left = header.frames() - first;
    let check = |number: usize, error: Error, change: &dyn Fn(&mut BlockHeader, &mut Vec<u8>)| {
        let changed = with_block(&bytes, number, change);
        assert_eq!(Clip::parse(&changed, LIMITS).unwrap_err(), error);
        // A stream counts from the first block.
        let Error::Malformed { field, at, found, low, high } = error else { panic!("{error}") };
        assert_eq!(
            streamed(&changed, 61).1,
            Err(Error::Malformed { field, at: at - start, found, low, high })
        );
    };
    let malformed = |field, at: usize, found, low, high| Error::Malformed {
        field,
        at: offsets[1] + at,
        found,
        low,
        high,
    };
    let most = u32::from(header.fields().block_bytes);
    check(1, malformed(Field::BlockLength, 0, most + 1, 0, most), &|_, codes| {
        codes.resize(most as usize + 1, 0);
    });
    check(1, malformed(Field::Frames, 2, 0, 1, left), &|block, _| block.frames = 0);
    check(1, malformed(Field::Frames, 2, left + 1, 1, left), &|block, _| block.frames = left as u16 + 1);
    check(1, malformed(Field::FirstFrame, 4, first + 1, first, first), &|block, _| block.first_frame += 1);
    check(1, malformed(Field::FirstFrame, 4, first - 1, first, first), &|block, _| block.first_frame -= 1);
    let entry = Error::Malformed { field: Field::Entry, at: offsets[0] + 7, found: 0, low: 1, high: 1 };
    check(0, entry, &|block, _| block.entry = false);

    // As many frames as are left are right, if nothing follows.
    let read =
        |block: BlockHeader, expected| BlockHeader::read(&block.emit(), 5, header.block_bounds(), expected);
    let last = BlockHeader { frames: left as u16, ..blocks[1].0 };
    assert_eq!(read(last, Some(first)), Ok(last));
    assert!(frames < left);
    // After a loss, any frame may come.
    assert_eq!(read(blocks[1].0, None), Ok(blocks[1].0));
    let high = header.frames() - 1;
    let beyond = BlockHeader { first_frame: high + 1, ..blocks[1].0 };
    let error = Error::Malformed { field: Field::FirstFrame, at: 9, found: high + 1, low: 0, high };
    assert_eq!(read(beyond, None), Err(error));
    assert!(BlockHeader::of(&vec![0; 65536], 1, 0, true).is_none());
}

#[test]
fn codes_of_another_length_than_the_block_are_refused() {
    let bytes = of_blocks();
    let (offsets, start) = (offsets(&bytes), header_bytes(&bytes));
    let (_, blocks) = taken_apart(&bytes);
    let length = u32::from(blocks[1].0.length);
    let before = usize::from(blocks[0].0.frames);
    let (sound, _) = in_place(&bytes);
    assert!(length < u32::from(Header::parse(&bytes, LIMITS).unwrap().fields().block_bytes));

    let longer = with_block(&bytes, 1, |_, codes| codes.push(0));
    let field = Field::BlockLength;
    let error = |at| Err(Error::Malformed { field, at, found: length + 1, low: length, high: length });
    let (frames, end) = in_place(&longer);
    assert_eq!(end, error(offsets[1]));
    assert!(frames.len() >= before && sound.starts_with(&frames));
    assert_eq!(streamed(&longer, 61), (frames, error(offsets[1] - start)));
    // The clip's last block, after whose last frame there would be no more.
    let last = offsets.len() - 1;
    let longer = with_block(&bytes, last, |_, codes| codes.push(0));
    let (frames, end) = in_place(&longer);
    assert_eq!(frames.len() + 1, in_place(&bytes).0.len());
    assert!(
        matches!(end, Err(Error::Malformed { field: Field::BlockLength, at, .. }) if at == offsets[last])
    );

    let shorter = with_block(&bytes, 1, |_, codes| {
        codes.pop();
    });
    let found = length as usize - 1;
    let error = |at| Err(Error::Truncated { field: Field::Payload, at, needed: found + 1, found });
    let (frames, end) = in_place(&shorter);
    assert_eq!(end, error(offsets[1] + BLOCK_HEADER_BYTES));
    assert!(frames.len() >= before && sound.starts_with(&frames));
    assert_eq!(streamed(&shorter, 61), (frames, error(offsets[1] - start + BLOCK_HEADER_BYTES)));
}

#[test]
fn a_damaged_block_is_passed_by_seeking_to_the_next_entry_point() {
    let bytes = of_blocks();
    let (sound, _) = in_place(&bytes);
    let (offsets, blocks) = (offsets(&bytes), taken_apart(&bytes).1);
    let mut damaged = bytes.clone();
    damaged[offsets[1] + BLOCK_HEADER_BYTES] ^= 4;
    let clip = Clip::parse(&damaged, LIMITS).unwrap();
    let mut lent = Heap::new(clip.header().needs());
    let mut decoder = clip.decoder(lent.memory()).unwrap();
    let first = blocks[1].0.first_frame;
    let error = decoder.seek(first).unwrap_err();
    let Error::Checksum { field, at, found, expected } = error else { panic!("{error}") };
    assert_eq!((field, at, expected), (Field::Payload, offsets[1], blocks[1].0.checksum));
    assert_ne!(found, expected);
    assert_eq!(decoder.next_frame(), Err(error));
    assert_eq!(decoder.position(), first);
    let entry = blocks[2..].iter().find(|(block, _)| block.entry).unwrap().0.first_frame;
    for frame in [entry, entry + 1, entry] {
        assert_eq!(decoder.seek(frame).unwrap(), sound.get(frame as usize).map(Vec::as_slice));
    }
    assert_eq!(decoder.seek(entry - 1), Err(error));
    assert_eq!(decoder.seek(0).unwrap(), sound.first().map(Vec::as_slice));
    decoder.rewind();
    assert_eq!(decoder.next_frame().unwrap(), sound.first().map(Vec::as_slice));
    assert_eq!(
        (decoder.clip().block_count() as usize, decoder.clip().header_bytes()),
        (blocks.len(), offsets[0])
    );
    assert_eq!(clip.entry_count() as usize, blocks.iter().filter(|(block, _)| block.entry).count());
}

#[test]
fn a_verified_clip_has_no_damaged_block() {
    let bytes = of_blocks();
    let (sound, _) = in_place(&bytes);
    let clip = Clip::parse(&bytes, LIMITS).unwrap();
    assert!(!clip.is_verified());
    let verified = clip.verify().unwrap();
    assert!(verified.is_verified());
    let mut lent = Heap::new(clip.header().needs());
    let mut decoder = verified.decoder(lent.memory()).unwrap();
    for frame in &sound {
        assert_eq!(decoder.next_frame().unwrap(), Some(frame.as_slice()));
    }
    for (number, at) in offsets(&bytes).into_iter().enumerate() {
        let mut damaged = bytes.clone();
        damaged[at + BLOCK_HEADER_BYTES] ^= 1;
        let error = Clip::parse(&damaged, LIMITS).unwrap().verify().unwrap_err();
        let place = at;
        assert!(
            matches!(error, Error::Checksum { field: Field::Payload, at, .. } if at == place),
            "{number}: {error}"
        );
    }
}

/// Loses the bytes from `lost` on, in chunks of any size; goes on at the block `next`.
fn numbers_after_loss(bytes: &[u8], lost: usize, next: usize, size: usize) -> Vec<usize> {
    let (sound, _) = in_place(bytes);
    let header = Header::parse(bytes, LIMITS).unwrap();
    let start = header_bytes(bytes);
    let mut lent = Heap::new(header.needs());
    let mut block = block_buffer(&header);
    let mut stream = Stream::new(header, lent.memory(), &mut block).unwrap();
    let mut numbers = Vec::new();
    for mut chunk in bytes[start..lost].chunks(size) {
        while stream.next_frame(&mut chunk).unwrap().is_some() {}
    }
    stream.resume();
    for mut chunk in bytes[next..].chunks(size) {
        while let Some(pose) = stream.next_frame(&mut chunk).unwrap() {
            let pose = pose.to_vec();
            let number = stream.position() as usize - 1;
            assert_eq!(sound.get(number), Some(&pose), "frame {number}");
            numbers.push(number);
        }
    }
    assert_eq!(stream.finish(), Ok(()));
    numbers
}

#[test]
fn a_stream_goes_on_at_the_first_entry_point_after_a_loss() {
    let bytes = of_blocks();
    let (offsets, blocks) = (offsets(&bytes), taken_apart(&bytes).1);
    for size in [1, 3, 10_000] {
        for lost in [offsets[0], offsets[0] + 5, offsets[1], offsets[1] + 13] {
            for next in 1..blocks.len() {
                let entry = blocks[next..].iter().find(|(block, _)| block.entry);
                let Some((entry, _)) = entry else { continue };
                let frames: usize = blocks.iter().map(|(block, _)| usize::from(block.frames)).sum();
                let numbers = numbers_after_loss(&bytes, lost, offsets[next], size);
                assert_eq!(numbers, (entry.first_frame as usize..frames).collect::<Vec<_>>());
            }
        }
    }
}

/// Where nothing but skipped blocks came after a loss, the end was not reached.
#[test]
fn skipped_blocks_are_no_end() {
    let bytes = of_blocks();
    let (offsets, header) = (offsets(&bytes), Header::parse(&bytes, LIMITS).unwrap());
    let mut lent = Heap::new(header.needs());
    let mut block = block_buffer(&header);
    let mut stream = Stream::new(header, lent.memory(), &mut block).unwrap();
    stream.resume();
    let mut chunk = &bytes[offsets[1]..offsets[2] - 1];
    assert_eq!(stream.next_frame(&mut chunk), Ok(None));
    assert!(chunk.is_empty());
    assert!(matches!(stream.finish(), Err(Error::Truncated { field: Field::BlockHeader, .. })));
}

#[test]
fn memory_that_is_too_small_is_told_with_the_size_that_is_needed() {
    let mut seen = [0; 4];
    for Vector { name, bytes, .. } in vectors("SHA256SUMS.mclip") {
        let header = Header::parse(&bytes, LIMITS).unwrap();
        let needs = header.needs();
        let parts = [
            (Field::Pose, needs.channels),
            (Field::States, needs.channels),
            (Field::Words, needs.words),
            (Field::Halves, needs.halves),
        ];
        for (part, (field, needed)) in parts.into_iter().enumerate() {
            if needed == 0 {
                continue;
            }
            seen[part] += 1;
            let mut own = Heap::new(needs);
            own.shrink(part);
            let error = Error::OutputTooSmall { field, needed, lent: needed - 1 };
            let clip = Clip::parse(&bytes, LIMITS).unwrap();
            assert_eq!(clip.decoder(own.memory()).unwrap_err(), error, "{name}");
            let mut block = block_buffer(&header);
            assert_eq!(Stream::new(header, own.memory(), &mut block).unwrap_err(), error);
        }
        let needed = block_buffer(&header).len();
        let mut block = vec![0; needed - 1];
        let error = Error::OutputTooSmall { field: Field::Payload, needed, lent: needed - 1 };
        let mut lent = Heap::new(needs);
        assert_eq!(Stream::new(header, lent.memory(), &mut block).unwrap_err(), error);
        let needed = header_bytes(&bytes);
        let mut buffer = vec![0; needed - 1];
        let error = Error::OutputTooSmall { field: Field::Header, needed, lent: needed - 1 };
        assert_eq!(Receiver::new(&mut buffer).receive(&mut bytes.as_slice()), Err(error));
    }
    assert!(seen.iter().all(|&count| count > 0), "{seen:?}");
}

/// What a decoder's bytes come to, counted from the types: 4 for a value, and what the others say.
#[test]
fn needs_count_every_byte() {
    for Vector { bytes, .. } in vectors("SHA256SUMS.mclip") {
        let needs = Header::parse(&bytes, LIMITS).unwrap().needs();
        assert_eq!(needs.bytes(), Heap::new(needs).bytes());
    }
}
