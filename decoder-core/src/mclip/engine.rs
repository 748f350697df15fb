//! What decoding in place, decoding a stream and encoding have in common: a pose, and a step to the next one.

use super::codec::{Choose, EntropyId, State, step};
use super::header::Header;
use crate::bits::BitReader;
use crate::entropy::huffman::TableError;
use crate::entropy::{AdaptiveHuffman, FixedWidth, Huffman, SymbolSource};
use crate::error::{Error, Field};
use crate::predict::Correlation;
use crate::quantise::Quantise;
use fixed::types::I16F16;

/// The memory that a decoder needs, in elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// Elements of the pose, and states.
    pub channels: usize,
    /// Adaptive predictors.
    pub correlations: usize,
    /// 16-bit words: of the predictors' sliding windows, and of the entropy stage.
    pub words: usize,
}

impl Needs {
    /// In bytes: 16 a channel, 16 more where the predictor adapts, and the words of windows and entropy stage.
    pub const fn bytes(&self) -> usize {
        self.channels
            .saturating_mul(size_of::<I16F16>().saturating_add(size_of::<State>()))
            .saturating_add(self.correlations.saturating_mul(size_of::<Correlation>()))
            .saturating_add(self.words.saturating_mul(size_of::<u16>()))
    }
}

/// Memory that the caller lends: at least [`Needs`] of each.
#[derive(Debug)]
pub struct Memory<'s> {
    /// The values of a frame.
    pub pose: &'s mut [I16F16],
    /// A state for every channel.
    pub states: &'s mut [State],
    /// An adaptive predictor for every channel, where the codec has one.
    pub correlations: &'s mut [Correlation],
    /// The predictors' windows and the entropy stage's.
    pub words: &'s mut [u16],
}

/// The entropy stage of a clip.
#[derive(Debug)]
enum Source<'s> {
    FixedWidth,
    Huffman(Huffman<'s>),
    Adaptive(AdaptiveHuffman<'s>),
}

/// A pose and all that its next one depends on.
#[derive(Debug)]
pub struct Engine<'a, 's> {
    header: Header<'a>,
    pose: &'s mut [I16F16],
    states: &'s mut [State],
    correlations: &'s mut [Correlation],
    /// A ring for every channel, where predictors have a sliding window.
    rings: &'s mut [u16],
    source: Source<'s>,
    /// Frames since the entry point.
    frame: u32,
}

impl<'a, 's> Engine<'a, 's> {
    /// An engine before any entry point. Builds the entropy stage's tables.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the tables are none.
    pub fn new(header: Header<'a>, memory: Memory<'s>) -> Result<Self, Error> {
        let needs = header.needs();
        let tables = header.opening().tables;
        let words = lent(memory.words, needs.words, Field::CodeTables)?;
        let of_rings = header.codec().ring_words().saturating_mul(needs.channels);
        // The needs have both, so there is enough to split.
        let (rings, words) = words.split_at_mut_checked(of_rings).unwrap_or_default();
        let bad_tables = Error::Encoding { field: Field::CodeTables, at: super::PREFIX_BYTES };
        let source = match header.entropy() {
            EntropyId::FixedWidth => Source::FixedWidth,
            EntropyId::Huffman => match Huffman::build(tables, words) {
                Ok(huffman) => Source::Huffman(huffman),
                Err(TableError::Range { found, low, high, .. }) => {
                    let at = super::PREFIX_BYTES;
                    return Err(Error::Malformed { field: Field::CodeTables, at, found, low, high });
                }
                Err(_) => return Err(bad_tables),
            },
            EntropyId::AdaptiveHuffman => {
                let bits = tables.first().copied().unwrap_or(0);
                Source::Adaptive(AdaptiveHuffman::new(bits, words).ok_or(bad_tables)?)
            }
        };
        Ok(Self {
            header,
            pose: lent(memory.pose, needs.channels, Field::Pose)?,
            states: lent(memory.states, needs.channels, Field::States)?,
            correlations: lent(memory.correlations, needs.correlations, Field::Correlations)?,
            rings,
            source,
            frame: 0,
        })
    }

    /// The header.
    pub const fn header(&self) -> &Header<'a> {
        &self.header
    }

    /// The last frame.
    pub const fn pose(&self) -> &[I16F16] {
        self.pose
    }

    /// Decodes the frame whose codes start at bit `position` of a block's codes; gives where they end. `entry` is
    /// true for the first frame of an entry point.
    pub(super) fn decode(&mut self, codes: &[u8], position: usize, entry: bool) -> Result<usize, ()> {
        let Self { header, pose, states, correlations, rings, source, frame } = self;
        let bits = BitReader::at(codes, position);
        let mut parts = Parts { header, pose, states, correlations, rings, frame };
        if entry && let Source::Adaptive(tree) = source {
            tree.reset();
        }
        let bits = match source {
            Source::FixedWidth => parts.decode(entry, bits, &mut FixedWidth),
            Source::Huffman(huffman) => parts.decode(entry, bits, &mut { *huffman }),
            Source::Adaptive(tree) => parts.decode(entry, bits, tree),
        };
        if bits.overrun() { Err(()) } else { Ok(bits.position()) }
    }

    /// Goes on to the frame whose symbols `choose` gives: an encoder's, which may choose by what is predicted.
    /// `entry` is true for the first frame of an entry point.
    pub fn choose<C: Choose>(&mut self, choose: &mut C, entry: bool) -> &[I16F16] {
        let Self { header, pose, states, correlations, rings, frame, .. } = self;
        Parts { header, pose, states, correlations, rings, frame }.frame(entry, choose);
        self.pose
    }
}

/// The engine without its entropy stage.
struct Parts<'e, 'a> {
    header: &'e Header<'a>,
    pose: &'e mut [I16F16],
    states: &'e mut [State],
    correlations: &'e mut [Correlation],
    rings: &'e mut [u16],
    frame: &'e mut u32,
}

impl Parts<'_, '_> {
    /// Decodes a frame and gives the bits that are left. The reader is the loop's own, so that it stays in registers.
    #[inline(always)]
    fn decode<'b, S: SymbolSource>(
        &mut self,
        entry: bool,
        bits: BitReader<'b>,
        source: &mut S,
    ) -> BitReader<'b> {
        let mut decode = Decode { bits, source };
        self.frame(entry, &mut decode);
        decode.bits
    }

    #[inline(always)]
    fn frame<C: Choose>(&mut self, entry: bool, choose: &mut C) {
        let codec = self.header.codec();
        if entry {
            self.enter(choose);
            if codec.has_entry_values() {
                return;
            }
        }
        *self.frame = self.frame.wrapping_add(1);
        step(codec, self.pose, self.states, self.correlations, self.rings, *self.frame, choose);
    }

    /// Sets every channel to what its record says, and to its value, if there is one.
    #[inline(never)]
    fn enter<C: Choose>(&mut self, choose: &mut C) {
        *self.frame = 0;
        self.correlations.fill(Correlation::default());
        let has_values = self.header.codec().has_entry_values();
        let slots = self.pose.iter_mut().zip(self.states.iter_mut());
        let mut index = 0usize;
        for ((value, state), channel) in slots.zip(self.header.channels()) {
            let bits = if has_values { channel.entry_bits() } else { 0 };
            let shift = channel.entry_shift;
            let steps = if bits == 0 { 0 } else { choose.entry(index, channel.low, shift, bits) };
            let first = channel.low.wrapping_add(steps.wrapping_shl(shift.into()).cast_signed());
            *value = I16F16::from_bits(first);
            *state = State::entry(&channel, first);
            index = index.wrapping_add(1);
        }
    }
}

/// Symbols from the bits of a block.
struct Decode<'d, 'b, S> {
    bits: BitReader<'b>,
    source: &'d mut S,
}

impl<S: SymbolSource> Choose for Decode<'_, '_, S> {
    #[inline(always)]
    fn entry(&mut self, _: usize, _: i32, _: u8, bits: u32) -> u32 {
        let low = bits.min(16);
        let high = self.bits.take(bits.saturating_sub(low));
        high.wrapping_shl(low) | self.bits.take(low)
    }

    #[inline(always)]
    fn symbol<Q: Quantise>(&mut self, _: usize, _: i32, _: &Q, state: &mut State) -> u32 {
        let width = state.bits();
        self.source.symbol(&mut self.bits, width, state.context())
    }
}

/// The front of what a caller lent.
pub(super) fn lent<T>(slice: &mut [T], needed: usize, field: Field) -> Result<&mut [T], Error> {
    let lent = slice.len();
    slice.get_mut(..needed).ok_or(Error::OutputTooSmall { field, needed, lent })
}
