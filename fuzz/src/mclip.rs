//! mclip: in place, streamed, after seeking and after losses, all is the same.

use crate::{Random, vectors};
use decoder_core::mclip::{
    BLOCK_HEADER_BYTES, Blocks, Clip, Decoder, Header, Prefix, Receiver, Stream, checksum,
};
use decoder_core::{Error, I16F16, Limits};
use encoder::memory::OwnedMemory;

/// More than any vector has.
const LIMITS: Limits = Limits { channels: 300, frames: 20_000 };

/// Most values of a clip that is decoded; a larger one is only parsed, or a few bytes would keep a run busy.
const MOST_VALUES: u64 = 200_000;

type Frame = Vec<i32>;

/// The golden vectors.
pub fn seeds() -> Vec<Vec<u8>> {
    vectors("SHA256SUMS.mclip")
}

/// Parses and decodes the bytes in every way, and once more with right checksums, which none of them would have.
///
/// # Panics
/// Where two ways differ, or the decoder panics.
pub fn check(bytes: &[u8]) -> bool {
    let mut repaired = bytes.to_vec();
    repair(&mut repaired);
    let accepted = repaired != bytes && check_as_it_is(&repaired);
    check_as_it_is(bytes) || accepted
}

fn check_as_it_is(bytes: &[u8]) -> bool {
    let mut random = Random::of(bytes);
    let parsed = Clip::parse(bytes, LIMITS);
    if let Ok(header) = Header::parse(bytes, LIMITS)
        && u64::from(header.frames()) * header.channel_count() as u64 > MOST_VALUES
    {
        return parsed.is_ok();
    }
    let (streamed, end) = streamed(bytes, &mut random);
    let clip = match parsed {
        Ok(clip) => clip,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            // A stream gives the frames before the damage.
            assert!(end.is_err(), "refused in place: {error}");
            return false;
        }
    };
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = match clip.decoder(memory.lend()) {
        Ok(decoder) => decoder,
        Err(error) => {
            assert_eq!(end, Err(error));
            return false;
        }
    };
    let (frames, in_place) = played(&mut decoder);
    assert_eq!(frames, streamed);
    assert_eq!(in_place.is_ok(), end.is_ok(), "{in_place:?} in place, {end:?} streamed");
    if in_place.is_err() {
        return false;
    }
    assert_eq!(frames.len(), clip.frames() as usize);
    for _ in 0..4 {
        let frame = random.below(frames.len());
        let found = decoder.seek(frame as u32).map(|pose| pose.map(words));
        assert_eq!(found.as_ref().map(Option::as_ref), Ok(frames.get(frame)), "seek to {frame}");
    }
    with_losses(bytes, &frames, &mut random);
    true
}

fn played(decoder: &mut Decoder<'_, '_>) -> (Vec<Frame>, Result<(), Error>) {
    let mut frames = Vec::new();
    loop {
        match decoder.next_frame() {
            Ok(Some(pose)) => frames.push(words(pose)),
            Ok(None) => return (frames, Ok(())),
            Err(error) => {
                assert_eq!(decoder.next_frame(), Err(error), "an error is repeated");
                return (frames, Err(error));
            }
        }
    }
}

fn streamed(bytes: &[u8], random: &mut Random) -> (Vec<Frame>, Result<(), Error>) {
    let longest = 1 << random.below(12);
    let mut chunks = random.chunks(bytes, longest).into_iter();
    let mut buffer = vec![0; bytes.len()];
    let mut frames = Vec::new();
    let end = (|| {
        let mut receiver = Receiver::new(&mut buffer);
        let mut chunk: &[u8] = &[];
        while !receiver.receive(&mut chunk)? {
            match chunks.next() {
                Some(next) => chunk = next,
                None => break,
            }
        }
        let header = receiver.finish(LIMITS)?;
        let mut memory = OwnedMemory::new(header.needs());
        let mut block = block_buffer(&header);
        let mut stream = Stream::new(header, memory.lend(), &mut block)?;
        loop {
            while let Some(pose) = stream.next_frame(&mut chunk)? {
                frames.push(words(pose));
            }
            assert!(chunk.is_empty(), "all of a chunk is taken");
            match chunks.next() {
                Some(next) => chunk = next,
                None => return stream.finish(),
            }
        }
    })();
    (frames, end)
}

/// Sends a sound clip over a link that loses some bytes. Whoever feeds the stream finds the next block again, as a
/// link with packets does, and the stream goes on at an entry point: each frame that it gives is the one of its
/// number.
fn with_losses(bytes: &[u8], frames: &[Frame], random: &mut Random) {
    let Ok(header) = Header::parse(bytes, LIMITS) else { return };
    let start = Prefix::read(bytes).map_or(bytes.len(), |prefix| prefix.header_bytes);
    let blocks: Vec<usize> =
        Blocks::new(header.block_bounds(), bytes, start, 0).flatten().map(|block| block.at).collect();
    let mut memory = OwnedMemory::new(header.needs());
    let mut block = block_buffer(&header);
    let Ok(mut stream) = Stream::new(header, memory.lend(), &mut block) else { return };
    let mut at = blocks.first().copied().unwrap_or(bytes.len());
    for _ in 0..3 {
        let end = at + random.below(bytes.len() - at);
        if feed(&mut stream, &bytes[at..end], frames, random).is_err() {
            stream.resume();
        }
        // Bytes from `end` on are lost; sometimes that is noticed because others came in between.
        let noise: Vec<u8> = (0..random.below(40)).map(|_| random.below(256) as u8).collect();
        let _ = feed(&mut stream, &noise, frames, random);
        stream.resume();
        match blocks.iter().find(|&&block| block >= end) {
            Some(&next) => at = next,
            None => return,
        }
    }
    assert_eq!(feed(&mut stream, &bytes[at..], frames, random), Ok(()), "sound blocks after a loss");
    assert_eq!(stream.finish().is_ok(), stream.position() as usize >= frames.len());
}

/// Feeds a stream; every frame must be the one that it says it is.
fn feed(
    stream: &mut Stream<'_, '_>,
    bytes: &[u8],
    frames: &[Frame],
    random: &mut Random,
) -> Result<(), Error> {
    for mut chunk in random.chunks(bytes, 61) {
        while let Some(pose) = stream.next_frame(&mut chunk)? {
            let found = words(pose);
            let number = stream.position() as usize - 1;
            assert_eq!(frames.get(number), Some(&found), "frame {number} after a loss");
        }
    }
    Ok(())
}

/// Puts right checksums over whatever is there, as far as lengths make sense.
pub fn repair(bytes: &mut [u8]) {
    let Ok(Prefix { header_bytes }) = Prefix::read(bytes) else { return };
    let Some((covered, sum)) = bytes.get_mut(..header_bytes).and_then(<[u8]>::split_last_chunk_mut) else {
        return;
    };
    *sum = checksum(covered, &[]).to_le_bytes();
    let mut rest = bytes.get_mut(header_bytes..).unwrap_or_default();
    while let Some((header, after)) = rest.split_first_chunk_mut::<BLOCK_HEADER_BYTES>() {
        let (covered, sum) = header.split_at_mut(8);
        let length = covered.first_chunk().map_or(0, |&length| u16::from_le_bytes(length));
        let Some((codes, after)) = after.split_at_mut_checked(length.into()) else { return };
        sum.copy_from_slice(&checksum(covered, codes).to_le_bytes());
        rest = after;
    }
}

fn block_buffer(header: &Header<'_>) -> Vec<u8> {
    vec![0; usize::from(header.fields().block_bytes).max(BLOCK_HEADER_BYTES)]
}

fn words(pose: &[I16F16]) -> Frame {
    pose.iter().map(|value| value.to_bits()).collect()
}
