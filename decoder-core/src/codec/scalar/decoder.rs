//! The decoder of all scalar codecs: a pose, and a step to the next one. Encoders run the same with codes of their choice.

use super::byte_groups::{Channels, GroupLoop, mark_widths, unpack};
use super::linked::LinkedScalar;
use super::loops::{CHUNK, Choose, ChosenCodes, Clock, Part, ReadCodes, fill};
use crate::bits::reader::{BitReader, MAX_TAKE};
use crate::channel::Channel;
use crate::codec::contract::{FrameDecoder, Shape};
use crate::entropy::linked::LinkedStage;
use crate::entropy::stage::FrameLoops;
use crate::entropy::symbols::SymbolSource;
use crate::error::Error;
use crate::memory::{Memory, Needs};
use crate::quantise::adaptive::{Adaptive, CLASSES};
use crate::state::State;
use fixed::types::I16F16;

/// A pose and all that its next one depends on. What every frame needs comes first.
#[derive(Debug)]
#[repr(C)]
pub struct ScalarDecoder<'a, 's> {
    channels: Channels<'s>,
    /// The loop over byte groups, where there is one.
    group_loop: Option<GroupLoop>,
    /// Bits of the block that were taken.
    position: usize,
    /// The quantiser that such a loop is handed.
    adaptive: Adaptive,
    codec: LinkedScalar<'a>,
    /// Whether an entry point has values of its own.
    has_entry_values: bool,
    stage: LinkedStage<'s>,
    words: &'s mut [u32],
    halves: &'s mut [u16],
    /// The last frame.
    clock: Clock,
}

/// The memory that a scalar codec's decoder needs.
pub fn needs(codec: &LinkedScalar<'_>, shape: &Shape<'_>) -> Needs {
    let own = codec.needs(shape.channels);
    let halves = own.halves.saturating_add(LinkedStage::halves(shape.entropy, shape.tables));
    Needs { channels: shape.channels, halves, ..own }
}

impl<'a, 's> ScalarDecoder<'a, 's> {
    /// A decoder before any entry point. Reads the channels' records, and builds the entropy stage's tables.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the tables are none.
    pub fn open(
        codec: LinkedScalar<'a>,
        shape: Shape<'a>,
        channels: impl Iterator<Item = Channel<'a>>,
        memory: Memory<'s>,
    ) -> Result<Self, Error> {
        let Memory { pose, states, words, halves } = memory.take(needs(&codec, &shape))?;
        // The needs have both, so there is enough to split.
        let own = codec.needs(shape.channels).halves;
        let (halves, of_stage) = halves.split_at_mut_checked(own).unwrap_or_default();
        let stage = LinkedStage::open(shape.entropy, shape.tables, shape.at, of_stage)?;
        for ((value, state), channel) in pose.iter_mut().zip(states.iter_mut()).zip(channels) {
            *value = I16F16::from_bits(channel.low);
            let (step, second) = codec.initial(&channel);
            *state = State::new(&channel, step, second);
            state.context = stage.context(channel.group, channel.bits);
        }
        let mut group_loop = None;
        if stage.has_byte_groups() {
            mark_widths(states);
            group_loop = codec.group_loop(states);
        }
        Ok(Self {
            position: 0,
            channels: Channels { pose, states },
            group_loop,
            adaptive: codec.adaptive().unwrap_or(Adaptive::new([0; CLASSES], 0, 0)),
            codec,
            has_entry_values: !codec.rules().grid,
            stage,
            words,
            halves,
            clock: Clock { frame: 0, row: 0, rows: codec.rows(), channels: shape.channels },
        })
    }

    /// The codec.
    pub const fn codec(&self) -> &LinkedScalar<'a> {
        &self.codec
    }

    /// Goes on to the frame whose codes `choose` gives: an encoder's, which may choose by what is predicted.
    /// `entry` is true for the first frame of an entry point.
    pub fn choose<C: Choose>(&mut self, choose: &mut C, entry: bool) -> &[I16F16] {
        if entry {
            self.restart();
            if self.has_entry_values {
                let keep = self.codec.keeps_values();
                let values = |channel, shift, bits| choose.entry(channel, shift, bits);
                set_values(self.channels.pose, self.channels.states, keep, values);
                return self.channels.pose;
            }
        }
        let Self { channels: Channels { pose, states }, words, halves, clock, codec, .. } = self;
        clock.advance();
        let all = Part { pose, states, words, halves, clock, channel: 0 };
        codec.advance(all, &mut ChosenCodes(choose));
        codec.finish(states, words, halves, clock);
        self.channels.pose
    }

    /// Decodes the next frame.
    #[inline(always)]
    fn decode(&mut self, codes: &[u8]) -> Option<()> {
        let position = self.position;
        self.position = if let Some(group_loop) = self.group_loop {
            let bytes = codes.get(position >> 3..)?;
            let rest = group_loop(&mut self.channels, &self.adaptive, bytes)?;
            codes.len().wrapping_sub(rest.len()).wrapping_mul(8)
        } else {
            self.decode_other(codes, position)?
        };
        Some(())
    }

    /// The same where the channels have no loop over byte groups; gives the bit where the codes end.
    #[inline(never)]
    fn decode_other(&mut self, codes: &[u8], position: usize) -> Option<usize> {
        let Self { channels: Channels { pose, states }, words, halves, clock, codec, stage, .. } = self;
        stage.feed(Frame { codec, pose, states, words, halves, clock, codes, position })
    }

    /// Decodes the values of an entry point.
    #[inline(never)]
    fn decode_values(&mut self, codes: &[u8]) -> Option<()> {
        let Channels { pose, states } = &mut self.channels;
        let position = if self.codec.keeps_values() {
            read_values::<true>(pose, states, codes)
        } else {
            read_values::<false>(pose, states, codes)
        };
        self.position = within(self.stage.codes_from(position), codes)?;
        Some(())
    }

    /// Sets all but the values of channels to what it is at an entry point. A function of its own, which takes no registers from
    /// the loop over the values.
    #[inline(never)]
    fn restart(&mut self) {
        let Self { channels: Channels { pose, states }, words, halves, clock, codec, stage, .. } = self;
        stage.restart(states.iter_mut().map(|state| &mut state.context));
        clock.frame = 0;
        // The first frame is to have row 0.
        clock.row = clock.rows;
        codec.restart(Part { pose, states, words, halves, clock, channel: 0 });
    }
}

impl FrameDecoder for ScalarDecoder<'_, '_> {
    #[inline(always)]
    fn begin(&mut self, codes: &[u8], entry: bool) -> Option<bool> {
        self.position = 0;
        if entry {
            self.restart();
            if self.has_entry_values {
                self.decode_values(codes)?;
                return Some(true);
            }
        }
        Some(false)
    }

    #[inline(always)]
    fn next_frame(&mut self, codes: &[u8]) -> Option<()> {
        self.decode(codes)
    }

    #[inline(always)]
    fn used(&self) -> usize {
        self.position.wrapping_add(7) >> 3
    }

    #[inline(always)]
    fn pose(&self) -> &[I16F16] {
        self.channels.pose
    }
}

/// A frame that is to be decoded.
struct Frame<'f, 'a> {
    codec: &'f LinkedScalar<'a>,
    pose: &'f mut [I16F16],
    states: &'f mut [State],
    words: &'f mut [u32],
    halves: &'f mut [u16],
    clock: &'f mut Clock,
    codes: &'f [u8],
    /// The bit where its codes begin.
    position: usize,
}

impl FrameLoops for Frame<'_, '_> {
    fn by_symbols<S: SymbolSource>(self, mut source: S) -> Option<usize> {
        let Self { codec, pose, states, words, halves, clock, codes, mut position } = self;
        if let Some(end) = codec.advance_symbols(pose, states, &mut source, codes, position) {
            return within(end, codes);
        }
        clock.advance();
        let mut buffer = [0; CHUNK];
        let mut rest =
            Part { pose, states: &mut *states, words: &mut *words, halves: &mut *halves, clock, channel: 0 };
        while !rest.pose.is_empty() {
            let now = rest.chunk(CHUNK);
            position = fill(&mut source, codes, position, now.states, &mut buffer);
            codec.advance(now, &mut ReadCodes(&buffer));
        }
        codec.finish(states, words, halves, clock);
        within(position, codes)
    }

    #[inline(never)]
    fn by_byte_groups(self) -> Option<usize> {
        let Self { codec, pose, states, words, halves, clock, codes, position } = self;
        let mut rest_of_codes = codes.get(position >> 3..)?;
        clock.advance();
        let mut buffer = [0; CHUNK];
        let mut rest =
            Part { pose, states: &mut *states, words: &mut *words, halves: &mut *halves, clock, channel: 0 };
        while !rest.pose.is_empty() {
            let now = rest.chunk(CHUNK);
            rest_of_codes = unpack(now.states, &mut buffer, rest_of_codes)?;
            codec.advance(now, &mut ReadCodes(&buffer));
        }
        codec.finish(states, words, halves, clock);
        Some(codes.len().wrapping_sub(rest_of_codes.len()).wrapping_mul(8))
    }
}

/// Reads the values of all channels at an entry point; gives the bit where they end. A function of its own, since its loop needs
/// all registers.
#[inline(never)]
fn read_values<const KEEP: bool>(pose: &mut [I16F16], states: &mut [State], codes: &[u8]) -> usize {
    let mut reader = BitReader::new(codes);
    set_values(pose, states, KEEP, |_, _, bits| {
        if bits <= MAX_TAKE {
            return reader.take_signed(bits);
        }
        let high = reader.take_signed(bits.wrapping_sub(MAX_TAKE));
        high.wrapping_shl(MAX_TAKE) | reader.take(MAX_TAKE).cast_signed()
    });
    reader.position()
}

/// A position in codes, which have to be as long.
const fn within(position: usize, codes: &[u8]) -> Option<usize> {
    if position > codes.len().saturating_mul(8) { None } else { Some(position) }
}

/// Sets all channels that have codes to their values at an entry point, and with `keep` the ones before these too. `value`
/// gives a channel's, by its number, shift and bits.
fn set_values(
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
