//! The codes of a motion into a clip.

use super::simulate::{Coded, Outline};
use crate::column::PRECISION;
use crate::entropy::coder::Coder;
use crate::entropy::huffman::{Books, CLASS_COUNTS};
use crate::mclip::blocks::{self, Frame};
use crate::mclip::header;
use decoder_core::entropy::AdaptiveHuffman;
use decoder_core::entropy::fixed_width::GROUP;
use decoder_core::entropy::huffman::Shape;
use decoder_core::mclip::{EntropyId, HeaderFields};

/// The clip that has these codes, with the entropy stage's best tables.
pub fn write(outline: &Outline<'_>, coded: &Coded, entropy: EntropyId, block_bytes: u16) -> Vec<u8> {
    match entropy {
        EntropyId::FixedWidth => {
            assemble_clip(outline, coded, entropy, block_bytes, &[], &mut Coder::FixedWidth)
        }
        EntropyId::Huffman => {
            let clips = CLASS_COUNTS.iter().map(|&classes| {
                let books = Books::fit(&contexts(outline, coded, classes), classes);
                assemble_clip(outline, coded, entropy, block_bytes, &books.bytes, &mut Coder::Huffman(&books))
            });
            clips.min_by_key(Vec::len).unwrap_or_default()
        }
        EntropyId::AdaptiveHuffman => {
            let clips = (3..=7u8).map(|bits| {
                let mut words = vec![0; AdaptiveHuffman::words(bits)];
                match AdaptiveHuffman::new(bits, &mut words) {
                    Some(tree) => assemble_clip(
                        outline,
                        coded,
                        entropy,
                        block_bytes,
                        &[bits],
                        &mut Coder::AdaptiveHuffman(tree),
                    ),
                    None => unreachable!("the memory is as large as the tree says"),
                }
            });
            clips.min_by_key(Vec::len).unwrap_or_default()
        }
    }
}

/// Every code with its width and the table of so many that it is read with, in order.
fn contexts(outline: &Outline<'_>, coded: &Coded, classes: u8) -> Vec<(i32, u8, u8)> {
    let shape = Shape { classes, groups: 1 };
    let mut out = Vec::with_capacity(coded.codes.len());
    let mut tables = vec![0; outline.channels.len()];
    walk(outline, coded, |_, part| {
        let Part::Codes(codes) = part else {
            tables.fill(0);
            return;
        };
        for (&code, (channel, bits)) in codes.iter().zip(active(outline)) {
            out.push((code, bits, tables[channel]));
            tables[channel] = shape.next_table(tables[channel], code);
        }
    });
    out
}

/// Channels that have codes, and their bits.
fn active<'p>(outline: &'p Outline<'_>) -> impl Iterator<Item = (usize, u8)> + 'p {
    let bits = outline.channels.iter().map(|channel| channel.bits);
    bits.enumerate().filter(|&(_, bits)| bits > 0)
}

/// A part of a frame.
enum Part<'c> {
    /// An entry point begins, with these values.
    Entry(&'c [(i32, u32)]),
    /// The codes of a frame.
    Codes(&'c [i32]),
}

/// Goes through all frames: the frame's number, and its parts.
fn walk(outline: &Outline<'_>, coded: &Coded, mut visit: impl FnMut(usize, Part<'_>)) {
    let has_values = !outline.grid;
    let count = active(outline).count();
    let mut codes = coded.codes.as_slice();
    let mut entries = coded.entries.iter();
    for frame in 0..outline.fields.frames as usize {
        if outline.is_entry(frame) {
            visit(frame, Part::Entry(entries.next().map_or(&[], Vec::as_slice)));
            if has_values {
                continue;
            }
        }
        let (now, later) = codes.split_at(count);
        codes = later;
        visit(frame, Part::Codes(now));
    }
}

fn assemble_clip(
    outline: &Outline<'_>,
    coded: &Coded,
    entropy: EntropyId,
    block_bytes: u16,
    tables: &[u8],
    coder: &mut Coder<'_>,
) -> Vec<u8> {
    let mut frames: Vec<Frame> = Vec::new();
    let mut contexts = vec![0; outline.channels.len()];
    walk(outline, coded, |frame, part| {
        if frames.len() == frame {
            frames.push(Frame { entry: outline.is_entry(frame), ..Frame::default() });
        }
        let out = &mut frames[frame].codes;
        match part {
            Part::Entry(values) => {
                values.iter().for_each(|&(value, bits)| out.put_signed(value, bits));
                contexts.fill(0);
                coder.restart(out);
            }
            Part::Codes(codes) => {
                let mut codes = codes.iter();
                let channels = outline.channels.iter().zip(&mut contexts).enumerate();
                for (number, (channel, context)) in channels {
                    if number % GROUP == 0 {
                        coder.align(out);
                    }
                    if channel.bits > 0
                        && let Some(&code) = codes.next()
                    {
                        coder.write(code, channel.bits, context, out);
                    }
                }
                coder.align(out);
            }
        }
    });
    let (blocks, longest) = blocks::emit(&frames, block_bytes);
    let fields = HeaderFields { entropy: entropy.id(), tables, block_bytes: longest, ..outline.fields };
    let mut bytes = header::emit(&fields, &outline.channels, PRECISION, outline.grid);
    bytes.extend(blocks);
    bytes
}
