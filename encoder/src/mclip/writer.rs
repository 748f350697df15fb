//! The bytes of a clip (docs/FORMAT.md, "mclip").

use super::bits::BitWriter;
use super::prefix::{Books, CLASS_COUNTS};
use super::record::Records;
use super::run::{Coded, Plan};
use decoder_core::arithmetic::unsigned;
use decoder_core::entropy::AdaptiveHuffman;
use decoder_core::entropy::fixed_width::GROUP;
use decoder_core::entropy::huffman::Shape;
use decoder_core::mclip::{BlockHeader, Channel, Clip, CodecId, EntropyId, Header, Opening};
use decoder_core::{Error, Limits};

/// Prefix, header and checksum. The memory that a decoder needs and the channels are filled in.
pub(super) fn header(opening: &Opening<'_>, channels: &[Channel<'_>], precision: u8) -> Vec<u8> {
    let Records { predictors, records, names } =
        Records::of(channels, precision, opening.codec == CodecId::Pcm.id());
    let opening =
        Opening { predictors: &predictors, records: &records, names: &names, ram: u32::MAX, ..*opening };
    // A header that asks for all memory is valid, and says what it needs.
    let most = assemble(&opening);
    let ram = Header::parse(&most, Limits::MAX).map_or(u32::MAX, |header| header.needs().bytes() as u32);
    assemble(&Opening { ram, ..opening })
}

fn assemble(opening: &Opening<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    opening.emit(&mut bytes);
    bytes
}

/// The clip with worst-case cycles of its frames in its header, each with the number of its core (docs/FORMAT.md, "Header"),
/// instead of those that it had.
///
/// # Errors
/// Where these bytes are no clip.
pub fn certify(clip: &[u8], cycles: &[(u8, u32)]) -> Result<Vec<u8>, Error> {
    let parsed = Clip::parse(clip, Limits::MAX)?;
    let entry = |&(core, cycles): &(u8, u32)| core::iter::once(core).chain(cycles.to_le_bytes());
    let cycles: Vec<u8> = cycles.iter().flat_map(entry).collect();
    let mut bytes = assemble(&Opening { cycles: &cycles, ..*parsed.header().opening() });
    bytes.extend(clip.iter().skip(parsed.header_bytes()));
    Ok(bytes)
}

pub(super) fn append(bytes: &mut Vec<u8>, value: &impl serde::Serialize) {
    match postcard::to_stdvec(value) {
        Ok(part) => bytes.extend(part),
        Err(error) => unreachable!("a vector grows: {error}"),
    }
}

/// Codes on their way to bits.
enum Coder<'c> {
    FixedWidth,
    Huffman(&'c Books),
    Adaptive(AdaptiveHuffman<'c>),
}

impl Coder<'_> {
    /// Writes a code of a channel whose context is the number of its table.
    fn write(&mut self, code: i32, width: u8, context: &mut u8, out: &mut BitWriter) {
        match self {
            Self::FixedWidth => out.put_signed(code, width.into()),
            Self::Huffman(books) => books.write(code, width, context, out),
            Self::Adaptive(tree) => {
                let coded = unsigned(code).min(tree.escape());
                let (prefix, length) = tree.code(coded);
                out.put(prefix, length);
                if coded == tree.escape() {
                    out.put_signed(code, width.into());
                }
                tree.count(coded);
            }
        }
    }
}

/// The clip that has these codes, with the entropy stage's best tables.
pub(super) fn write(plan: &Plan<'_>, coded: &Coded, entropy: EntropyId) -> Vec<u8> {
    match entropy {
        EntropyId::FixedWidth => assemble_clip(plan, coded, entropy, &[], &mut Coder::FixedWidth),
        EntropyId::Huffman => {
            let clips = CLASS_COUNTS.iter().map(|&classes| {
                let books = Books::fit(&contexts(plan, coded, classes), classes);
                assemble_clip(plan, coded, entropy, &books.bytes, &mut Coder::Huffman(&books))
            });
            clips.min_by_key(Vec::len).unwrap_or_default()
        }
        EntropyId::AdaptiveHuffman => {
            let clips = (3..=7u8).map(|bits| {
                let mut words = vec![0; AdaptiveHuffman::words(bits)];
                match AdaptiveHuffman::new(bits, &mut words) {
                    Some(tree) => assemble_clip(plan, coded, entropy, &[bits], &mut Coder::Adaptive(tree)),
                    None => unreachable!("the memory is as large as the tree says"),
                }
            });
            clips.min_by_key(Vec::len).unwrap_or_default()
        }
    }
}

/// Every code with its width and the table of so many that it is read with, in order.
fn contexts(plan: &Plan<'_>, coded: &Coded, classes: u8) -> Vec<(i32, u8, u8)> {
    let shape = Shape { classes, groups: 1 };
    let mut out = Vec::with_capacity(coded.codes.len());
    let mut tables = vec![0; plan.channels.len()];
    walk(plan, coded, |_, part| {
        let Frame::Codes(codes) = part else {
            tables.fill(0);
            return;
        };
        for (&code, (channel, bits)) in codes.iter().zip(active(plan)) {
            out.push((code, bits, tables[channel]));
            tables[channel] = shape.next_table(tables[channel], code);
        }
    });
    out
}

/// Channels that have codes, and their bits.
fn active<'p>(plan: &'p Plan<'_>) -> impl Iterator<Item = (usize, u8)> + 'p {
    let bits = plan.channels.iter().map(|channel| channel.bits);
    bits.enumerate().filter(|&(_, bits)| bits > 0)
}

/// A part of a frame.
enum Frame<'c> {
    /// An entry point begins, with these values.
    Entry(&'c [(i32, u32)]),
    /// The codes of a frame.
    Codes(&'c [i32]),
}

/// Goes through all frames: the frame's number, and its parts.
fn walk(plan: &Plan<'_>, coded: &Coded, mut visit: impl FnMut(usize, Frame<'_>)) {
    let has_values = plan.opening.codec != CodecId::Pcm.id();
    let count = active(plan).count();
    let mut codes = coded.codes.as_slice();
    let mut entries = coded.entries.iter();
    for frame in 0..plan.opening.frames as usize {
        if plan.is_entry(frame) {
            visit(frame, Frame::Entry(entries.next().map_or(&[], Vec::as_slice)));
            if has_values {
                continue;
            }
        }
        let (now, later) = codes.split_at(count);
        codes = later;
        visit(frame, Frame::Codes(now));
    }
}

/// A block that is being filled.
#[derive(Default)]
struct Block {
    codes: BitWriter,
    frames: u16,
    first_frame: u32,
    entry: bool,
}

impl Block {
    fn finish(&mut self, bytes: &mut Vec<u8>, longest: &mut usize) {
        if self.frames == 0 {
            return;
        }
        let codes = self.codes.take();
        *longest = codes.len().max(*longest);
        if let Some(header) = BlockHeader::of(&codes, self.frames, self.first_frame, self.entry) {
            bytes.extend(header.emit());
            bytes.extend(codes);
        }
        *self = Self { first_frame: self.first_frame + u32::from(self.frames), ..Self::default() };
    }
}

fn assemble_clip(
    plan: &Plan<'_>,
    coded: &Coded,
    entropy: EntropyId,
    tables: &[u8],
    coder: &mut Coder<'_>,
) -> Vec<u8> {
    let most = usize::from(plan.opening.block_bytes);
    let mut frames: Vec<(bool, BitWriter)> = Vec::new();
    let mut contexts = vec![0; plan.channels.len()];
    walk(plan, coded, |frame, part| {
        if frames.len() == frame {
            frames.push((plan.is_entry(frame), BitWriter::default()));
        }
        let out = &mut frames[frame].1;
        match part {
            Frame::Entry(values) => {
                values.iter().for_each(|&(value, bits)| out.put_signed(value, bits));
                contexts.fill(0);
                match coder {
                    Coder::FixedWidth => out.align(),
                    Coder::Huffman(_) => {}
                    Coder::Adaptive(tree) => tree.reset(),
                }
            }
            Frame::Codes(codes) => {
                let mut codes = codes.iter();
                let channels = plan.channels.iter().zip(&mut contexts).enumerate();
                for (number, (channel, context)) in channels {
                    if number % GROUP == 0 && matches!(coder, Coder::FixedWidth) {
                        out.align();
                    }
                    if channel.bits > 0
                        && let Some(&code) = codes.next()
                    {
                        coder.write(code, channel.bits, context, out);
                    }
                }
                if matches!(coder, Coder::FixedWidth) {
                    out.align();
                }
            }
        }
    });
    let mut blocks = Vec::new();
    let mut longest = 0;
    let mut block = Block::default();
    for (entry, codes) in &frames {
        let full = (block.codes.length() + codes.length()).div_ceil(8) > most || block.frames == u16::MAX;
        if *entry || full {
            block.finish(&mut blocks, &mut longest);
            block.entry = *entry;
        }
        block.codes.append(codes);
        block.frames += 1;
    }
    block.finish(&mut blocks, &mut longest);
    let opening = Opening { entropy: entropy.id(), tables, block_bytes: longest as u16, ..plan.opening };
    let mut bytes = header(&opening, &plan.channels, plan.precision);
    bytes.extend(blocks);
    bytes
}
