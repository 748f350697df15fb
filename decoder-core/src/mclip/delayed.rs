//! A codec whose poses lag behind their codes, which none of today's does: in place, streamed, after seeking and after a loss.

use super::block::BlockHeader;
use super::clip::Clip;
use super::decoder::ClipDecoder;
use super::fields::HeaderFields;
use super::header::Header;
use super::stream::BlockStream;
use crate::I16F16;
use crate::codec::contract::FrameDecoder;
use crate::error::Limits;
use crate::ids::{CodecId, EntropyId};
use std::collections::VecDeque;
use std::vec::Vec;

/// A byte a frame, which is added to the value of the frame before; an entry point begins at 0.
struct Delayed {
    at: usize,
    value: i32,
    /// Poses that are still to be given, the next one first.
    line: VecDeque<i32>,
    pose: [I16F16; 1],
    delay: u16,
}

impl Delayed {
    fn new(delay: u16) -> Self {
        Self { at: 0, value: 0, line: [-1].repeat(delay.into()).into(), pose: [I16F16::ZERO], delay }
    }

    fn shift(&mut self, value: i32) {
        self.line.push_back(value);
        self.pose = [I16F16::from_bits(self.line.pop_front().unwrap())];
    }
}

impl FrameDecoder for Delayed {
    fn delay(&self) -> u16 {
        self.delay
    }

    fn begin(&mut self, _: &[u8], entry: bool) -> Option<bool> {
        self.at = 0;
        if entry {
            self.value = 0;
        }
        Some(false)
    }

    fn next_frame(&mut self, codes: &[u8]) -> Option<()> {
        self.value += i32::from(*codes.get(self.at)?);
        self.at += 1;
        self.shift(self.value);
        Some(())
    }

    fn drain(&mut self) {
        self.shift(-2);
    }

    fn used(&self) -> usize {
        self.at
    }

    fn pose(&self) -> &[I16F16] {
        &self.pose
    }
}

/// Frames of each block, and whether it is an entry point.
const BLOCKS: [(u16, bool); 6] = [(4, true), (3, false), (1, true), (2, true), (5, false), (6, true)];

/// A clip's bytes, its frames' values, and where its blocks begin.
fn clip() -> (Vec<u8>, Vec<i32>, Vec<usize>) {
    let frames = BLOCKS.iter().map(|(frames, _)| u32::from(*frames)).sum();
    let fields = HeaderFields {
        rate_numerator: 30,
        rate_denominator: 1,
        frames,
        channels: 1,
        block_bytes: 6,
        ram: u32::MAX,
        delay: 0,
        codec: CodecId::Pcm.id(),
        entropy: EntropyId::FixedWidth.id(),
        parameters: &[],
        tables: &[],
        cycles: &[],
        predictors: &[],
        // A channel of 0 bits, whose value is 0.
        records: &[0, 0, 0, 0, 0, 0, 0, 0, 0],
        names: &[],
    };
    let (mut bytes, mut values, mut starts) = (Vec::new(), Vec::new(), Vec::new());
    fields.emit(&mut bytes);
    let (mut first, mut value) = (0u32, 0);
    for (frames, entry) in BLOCKS {
        let codes: Vec<u8> = (0..frames).map(|frame| (first as u8 + frame as u8) * 7 + 1).collect();
        value = if entry { 0 } else { value };
        for &code in &codes {
            value += i32::from(code);
            values.push(value);
        }
        starts.push(bytes.len());
        bytes.extend(BlockHeader::of(&codes, frames, first, entry).unwrap().emit());
        bytes.extend(codes);
        first += u32::from(frames);
    }
    (bytes, values, starts)
}

fn value(pose: &[I16F16]) -> i32 {
    pose[0].to_bits()
}

/// More than the clip has frames, too.
const DELAYS: [u16; 5] = [0, 1, 3, 20, 40];

#[test]
fn a_decoder_gives_every_frame_and_finds_each_again() {
    let (bytes, values, _) = clip();
    let clip = Clip::parse(&bytes, Limits::MAX).unwrap();
    for delay in DELAYS {
        let mut decoder = ClipDecoder::new(clip, Delayed::new(delay));
        for _ in 0..2 {
            for (number, &expected) in (0..).zip(&values) {
                assert_eq!(decoder.position(), number, "delay {delay}");
                assert_eq!(
                    decoder.next_frame().unwrap().map(value),
                    Some(expected),
                    "{delay}: frame {number}"
                );
            }
            assert_eq!((decoder.position(), decoder.next_frame()), (clip.frames(), Ok(None)));
            decoder.rewind();
        }
        for round in 0..values.len() as u32 * 3 {
            let frame = round * 8 % clip.frames();
            let found = decoder.seek(frame).unwrap().map(value);
            assert_eq!(found, values.get(frame as usize).copied(), "{delay}: seek to {frame}");
            assert_eq!(decoder.position(), frame + 1);
        }
    }
}

#[test]
fn a_stream_gives_every_frame_and_goes_on_after_a_loss() {
    let (bytes, values, starts) = clip();
    let header = Header::parse(&bytes, Limits::MAX).unwrap();
    for delay in DELAYS {
        for (size, from) in [(1, 0), (7, 0), (100, 0), (5, 1), (5, 4)] {
            let mut buffer = [0; 12];
            let mut stream = BlockStream::with_decoder(header, Delayed::new(delay), &mut buffer).unwrap();
            let mut expected = 0;
            if from > 0 {
                stream.resume();
                let entry = BLOCKS.iter().skip(from).position(|&(_, entry)| entry).unwrap() + from;
                expected = BLOCKS[..entry].iter().map(|&(frames, _)| u32::from(frames)).sum();
            }
            for mut chunk in bytes[starts[from]..].chunks(size) {
                while let Some(pose) = stream.next_frame(&mut chunk).unwrap() {
                    assert_eq!(value(pose), values[expected as usize], "{delay}: frame {expected}");
                    expected += 1;
                    assert_eq!(stream.position(), expected);
                }
            }
            assert_eq!((expected, stream.finish()), (header.frames(), Ok(())), "delay {delay}, from {from}");
        }
    }
}
