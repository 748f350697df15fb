//! What decoding in place, decoding a stream and encoding have in common: a pose, and a step to the next one.

use super::channels::{At, Channels, Choose};
use super::codec::{Codec, EntropyId};
use super::header::Header;
use super::octets::{self, Lanes, Loop};
use super::state::State;
use crate::bits::{BitReader, MAX_TAKE};
use crate::entropy::huffman::{NO_TABLE, TableError};
use crate::entropy::{AdaptiveHuffman, Huffman};
use crate::error::{Error, Field};
use crate::predict::{Correlation, Ring};
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
    /// In bytes: 16 a channel, 16 more where the predictor adapts by an exponential window, and the words of windows and entropy stage.
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
    /// A correlation for every channel, where the predictor has an exponential window.
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

/// A pose and all that its next one depends on. What every frame needs comes first.
#[derive(Debug)]
#[repr(C)]
pub struct Engine<'a, 's> {
    lanes: Lanes<'s>,
    /// The loop over octets, where there is one.
    run: Option<Loop>,
    header: Header<'a>,
    correlations: &'s mut [Correlation],
    /// A row for each frame of them, where predictors have a sliding window.
    windows: &'s mut [u16],
    source: Source<'s>,
    /// The last frame.
    at: At,
}

impl<'a, 's> Engine<'a, 's> {
    /// An engine before any entry point. Reads the channels' records, and builds the entropy stage's tables.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the tables are none.
    pub fn new(header: Header<'a>, memory: Memory<'s>) -> Result<Self, Error> {
        let needs = header.needs();
        let tables = header.opening().tables;
        let words = lent(memory.words, needs.words, Field::CodeTables)?;
        let length = header.codec().ring_words();
        let of_windows = length.saturating_mul(needs.channels);
        // The needs have both, so there is enough to split.
        let (windows, words) = words.split_at_mut_checked(of_windows).unwrap_or_default();
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
        let pose = lent(memory.pose, needs.channels, Field::Pose)?;
        let states = lent(memory.states, needs.channels, Field::States)?;
        let slots = pose.iter_mut().zip(states.iter_mut());
        for ((value, state), channel) in slots.zip(header.channels().unnamed()) {
            *value = I16F16::from_bits(channel.low);
            *state = State::of(header.codec(), &channel);
            if let Source::Huffman(huffman) = &source {
                let first = huffman.shape().first_table(channel.group);
                state.context = if channel.bits == 0 { NO_TABLE } else { first };
            }
        }
        let mut run = None;
        if matches!(source, Source::FixedWidth) && cfg!(feature = "fixed-width") {
            octets::mark(states);
            run = octets::choose(header.codec(), states);
        }
        Ok(Self {
            lanes: Lanes { pose, states },
            run,
            header,
            correlations: lent(memory.correlations, needs.correlations, Field::Correlations)?,
            windows,
            source,
            at: At { frame: 0, row: 0, length, channels: needs.channels },
        })
    }

    /// The header.
    pub const fn header(&self) -> &Header<'a> {
        &self.header
    }

    /// The last frame.
    pub const fn pose(&self) -> &[I16F16] {
        self.lanes.pose
    }

    /// Decodes the frame whose codes start at bit `position` of a block's codes; gives where they end.
    #[inline(always)]
    pub(super) fn decode(&mut self, codes: &[u8], position: usize) -> Option<usize> {
        let Some(run) = self.run else { return self.decode_other(codes, position) };
        let bytes = codes.get(position >> 3..)?;
        let rest = run(&mut self.lanes, self.header.codec(), bytes)?;
        Some(codes.len().wrapping_sub(rest.len()).wrapping_mul(8))
    }

    /// The same where the channels have no loop over octets.
    #[inline(never)]
    fn decode_other(&mut self, codes: &[u8], position: usize) -> Option<usize> {
        let Self { header, lanes: Lanes { pose, states }, correlations, windows, source, at, .. } = self;
        let codec = header.codec();
        let channels = Channels { pose, states, correlations, windows, at };
        match source {
            Source::FixedWidth if cfg!(feature = "fixed-width") => {
                let rest = channels.step_unpacked(codec, codes.get(position >> 3..)?)?;
                Some(codes.len().wrapping_sub(rest.len()).wrapping_mul(8))
            }
            Source::Huffman(source) if cfg!(feature = "huffman") => {
                within(channels.step_coded(codec, codes, position, *source), codes)
            }
            Source::Adaptive(source) if cfg!(feature = "adaptive-huffman") => {
                within(channels.step_coded(codec, codes, position, source), codes)
            }
            // Refused by `EntropyId::check_linked`.
            _ => None,
        }
    }

    /// Decodes the first frame of an entry point.
    #[inline(always)]
    pub(super) fn decode_entry(&mut self, codes: &[u8], position: usize) -> Option<usize> {
        let position = self.decode_values(codes, position)?;
        if self.header.codec().has_entry_values() {
            return Some(position);
        }
        self.decode(codes, position)
    }

    /// Decodes the values of an entry point; gives where they end.
    // Its loop needs more registers than Cortex-M4 has beside its caller's; on Cortex-M0+ a call costs more than it saves.
    #[cfg_attr(target_has_atomic = "32", inline(never))]
    fn decode_values(&mut self, codes: &[u8], position: usize) -> Option<usize> {
        self.reset();
        let mut position = position;
        if self.header.codec().has_entry_values() {
            let keep = self.header.codec().keeps_values();
            let mut reader = BitReader::at(codes, position);
            enter(self.lanes.pose, self.lanes.states, keep, |_, _, bits| {
                if bits <= MAX_TAKE {
                    return reader.take_signed(bits);
                }
                let high = reader.take_signed(bits.wrapping_sub(MAX_TAKE));
                high.wrapping_shl(MAX_TAKE) | reader.take(MAX_TAKE).cast_signed()
            });
            position = reader.position();
        }
        match &mut self.source {
            Source::FixedWidth => position = position.wrapping_add(7) & !7,
            Source::Huffman(_) => {}
            Source::Adaptive(tree) => tree.reset(),
        }
        within(position, codes)
    }

    /// Goes on to the frame whose codes `choose` gives: an encoder's, which may choose by what is predicted.
    /// `entry` is true for the first frame of an entry point.
    pub fn choose<C: Choose>(&mut self, choose: &mut C, entry: bool) -> &[I16F16] {
        if entry {
            self.reset();
            if self.header.codec().has_entry_values() {
                let keep = self.header.codec().keeps_values();
                enter(self.lanes.pose, self.lanes.states, keep, |channel, shift, bits| {
                    choose.entry(channel, shift, bits)
                });
            }
        }
        let codec = self.header.codec();
        if !(entry && codec.has_entry_values()) {
            let channels = Channels {
                pose: self.lanes.pose,
                states: self.lanes.states,
                correlations: self.correlations,
                windows: self.windows,
                at: &mut self.at,
            };
            channels.step(codec, choose);
        }
        self.lanes.pose
    }

    /// Sets all but the values of channels to what it is at an entry point.
    fn reset(&mut self) {
        self.at.frame = 0;
        self.correlations.fill(Correlation::default());
        if let Source::Huffman(huffman) = &self.source {
            let shape = huffman.shape();
            self.lanes.states.iter_mut().for_each(|state| state.context = shape.first_of(state.context));
        }
        let codec = self.header.codec();
        if let Codec::Adpcm(adpcm) = codec {
            if adpcm.quantiser.adapts() {
                self.lanes.states.iter_mut().for_each(State::reset_step);
            }
            if adpcm.predictor.is_some() {
                // The first frame is to have row 0.
                self.at.row = self.at.length;
                Ring::clear(self.windows, self.at.channels);
                self.lanes.states.iter_mut().for_each(|state| state.second = 0);
            }
        }
    }
}

/// A position in codes, which have to be as long.
const fn within(position: usize, codes: &[u8]) -> Option<usize> {
    if position > codes.len().saturating_mul(8) { None } else { Some(position) }
}

/// Sets all channels that have codes to their values at an entry point, and with `keep` the ones before these too. `value`
/// gives a channel's, by its number, shift and bits.
fn enter(
    pose: &mut [I16F16],
    states: &mut [State],
    keep: bool,
    mut value: impl FnMut(usize, u32, u32) -> i32,
) {
    for (channel, (pose, state)) in (0..usize::MAX).zip(pose.iter_mut().zip(states)) {
        if state.bits() > 0 {
            let (bits, shift) = state.entry();
            let first = value(channel, shift, bits).wrapping_shl(shift);
            *pose = I16F16::from_bits(first);
            if keep {
                state.second = first;
            }
        }
    }
}

/// The front of what a caller lent.
pub(super) fn lent<T>(slice: &mut [T], needed: usize, field: Field) -> Result<&mut [T], Error> {
    let lent = slice.len();
    slice.get_mut(..needed).ok_or(Error::OutputTooSmall { field, needed, lent })
}
