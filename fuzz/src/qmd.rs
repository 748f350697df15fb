//! QMD clips: in place with and without a converted table, streamed and after seeking, all is the same.

use crate::{Random, vectors};
use decoder_core::qmd::{Clip, MAX_INDEX_BITS, SEGMENT_HEADER_BYTES, Stream};
use decoder_core::{Error, I16F16, Limits};

/// More than any vector has.
const LIMITS: Limits = Limits { channels: 300, frames: 10_000 };

type Frame = Vec<i32>;

/// The golden vectors.
pub fn seeds() -> Vec<Vec<u8>> {
    vectors("SHA256SUMS")
}

/// Parses and decodes in every way.
///
/// # Panics
/// Where two ways differ, or the decoder panics.
pub fn check(bytes: &[u8]) -> bool {
    let mut random = Random::of(bytes);
    let (streamed, end) = streamed(bytes, &mut random);
    let clip = match Clip::parse(bytes, LIMITS) {
        Ok(clip) => clip,
        Err(error) => {
            // Where a whole field is missing in memory, a unit of it is in a stream.
            let truncated = matches!(error, Error::Truncated { .. });
            assert!(if truncated { end.is_err() } else { end == Err(error) }, "{error:?} but {end:?}");
            assert!(!error.to_string().is_empty());
            return false;
        }
    };
    assert_eq!(end, Ok(()), "accepted in place");
    let mut table = vec![0; clip.table_len()];
    let frames = played(&clip, None, &mut random);
    assert_eq!(frames, played(&clip, Some(&mut table), &mut random), "with a converted table");
    assert_eq!(frames, streamed);
    assert_eq!(frames.len(), clip.frames() as usize);
    true
}

/// All frames, in which seeking ends up at the same ones.
fn played(clip: &Clip<'_>, table: Option<&mut [i32]>, random: &mut Random) -> Vec<Frame> {
    let mut pose = vec![I16F16::ZERO; clip.channels()];
    let mut decoder = clip.decoder(&mut pose, table).expect("memory as the clip says");
    let mut frames = Vec::new();
    while let Some(pose) = decoder.next_frame() {
        frames.push(words(pose));
    }
    for _ in 0..4 {
        let frame = random.below(frames.len());
        assert_eq!(decoder.seek(frame as u32).map(words).as_ref(), frames.get(frame), "seek to {frame}");
    }
    assert_eq!(decoder.seek(clip.frames()), None);
    frames
}

fn streamed(bytes: &[u8], random: &mut Random) -> (Vec<Frame>, Result<(), Error>) {
    let mut pose = vec![I16F16::ZERO; LIMITS.channels.into()];
    let mut table = vec![0; 1 << MAX_INDEX_BITS];
    let mut buffer = vec![0; SEGMENT_HEADER_BYTES.max(4 * usize::from(LIMITS.channels))];
    let mut stream = Stream::new(LIMITS, &mut pose, &mut table, &mut buffer);
    let mut frames = Vec::new();
    let longest = 1 << random.below(12);
    for mut chunk in random.chunks(bytes, longest) {
        loop {
            match stream.next_frame(&mut chunk) {
                Ok(Some(pose)) => frames.push(words(pose)),
                Ok(None) => break,
                Err(error) => {
                    assert_eq!(stream.next_frame(&mut chunk), Err(error), "an error is repeated");
                    assert_eq!(stream.finish(), Err(error));
                    return (frames, Err(error));
                }
            }
        }
        assert!(chunk.is_empty(), "all of a chunk is taken");
    }
    (frames, stream.finish())
}

fn words(pose: &[I16F16]) -> Frame {
    pose.iter().map(|value| value.to_bits()).collect()
}
