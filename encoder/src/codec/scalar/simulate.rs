//! The decoder's own loop, with codes that are chosen to come close to a motion.

use super::contract::{Allocation, ScalarEncode};
use crate::column::{Choice, Column, PRECISION};
use crate::mclip::header;
use crate::memory::OwnedMemory;
use crate::task::Task;
use decoder_core::codec::RunningCodec;
use decoder_core::mclip::{Channel, Choose, EntropyId, Header, HeaderFields, State};
use decoder_core::quantise::Quantise;
use decoder_core::{Error, Limits};

/// All of a clip but its codes: its header's fields, its channels, and where its entry points are.
#[derive(Clone, Debug)]
pub struct Outline<'p> {
    /// The header's fields; channels, memory, blocks and entropy stage are not in them yet.
    pub fields: HeaderFields<'p>,
    /// The channels.
    pub channels: Vec<Channel<'p>>,
    /// Frames from one entry point to the next.
    pub entry_frames: usize,
    /// Whether channels have grids: [`Rules::grid`](decoder_core::Rules::grid) of the codec.
    pub grid: bool,
}

/// The codes of a motion, and what a decoder makes of them.
#[derive(Clone, Debug, Default)]
pub struct Coded {
    /// For each entry point, the values that it starts with and their bits.
    pub entries: Vec<Vec<(i32, u32)>>,
    /// Codes of all frames but those of entry points (pcm: of all frames), channels without bits left out.
    pub codes: Vec<i32>,
    /// For every code, the difference that it is to come near to.
    pub wanted: Vec<i32>,
    /// The decoded words, row-major.
    pub decoded: Vec<i32>,
}

/// What a decoder makes of a whole motion.
///
/// # Errors
/// Where the allocation is none that a header can have.
pub fn clip(codec: &dyn ScalarEncode, task: &Task<'_>, allocation: &Allocation) -> Result<Coded, Error> {
    let outline = Outline::of_clip(codec, task, allocation);
    outline.simulate(&task.motion.source.targets, allocation.dead_zone)
}

/// What a decoder makes of one channel alone, where `allocation` has its choice only.
///
/// A predictor that adapts does so on frames that depend on the channel's place, so channels at rest stand before
/// this one: otherwise a code may be wider in the clip than it was here, and would be cut off.
///
/// # Errors
/// Where the allocation is none that a header can have.
pub fn column(
    codec: &dyn ScalarEncode,
    entry_frames: usize,
    column: &Column,
    parameters: &[u8],
    choice: Choice,
    dead_zone: i32,
) -> Result<Coded, Error> {
    let before = column.index % codec.turns();
    let rest = codec.record(&Column::REST, Choice::REST);
    let mut channels = vec![rest; before];
    channels.push(codec.record(column, choice));
    let fields = fields(codec, parameters, column.targets.len(), channels.len());
    let mut targets = vec![0; column.targets.len() * (before + 1)];
    for (row, &target) in targets.chunks_exact_mut(before + 1).zip(&column.targets) {
        row[before] = target;
    }
    let mut coded =
        Outline { fields, channels, entry_frames, grid: codec.has_grids() }.simulate(&targets, dead_zone)?;
    coded.decoded = coded.decoded.into_iter().skip(before).step_by(before + 1).collect();
    Ok(coded)
}

/// The fields of a header that says nothing of the rate, and has neither tables nor channels yet.
fn fields<'p>(
    codec: &dyn ScalarEncode,
    parameters: &'p [u8],
    frames: usize,
    channels: usize,
) -> HeaderFields<'p> {
    HeaderFields {
        rate_numerator: 1,
        rate_denominator: 1,
        frames: frames as u32,
        channels: channels as u16,
        block_bytes: 0,
        ram: 0,
        delay: 0,
        codec: codec.id().id(),
        entropy: EntropyId::FixedWidth.id(),
        parameters,
        tables: &[],
        cycles: &[],
        predictors: &[],
        records: &[],
        names: &[],
    }
}

impl<'p> Outline<'p> {
    /// The outline of a whole clip.
    pub fn of_clip(codec: &dyn ScalarEncode, task: &Task<'p>, allocation: &'p Allocation) -> Self {
        let motion = task.motion;
        let records = motion.columns.iter().zip(&allocation.choices).zip(motion.labels());
        let channels = records.map(|((column, &choice), (joint, kind))| Channel {
            joint,
            kind,
            ..codec.record(column, choice)
        });
        let (frames, count) = (motion.source.frames, motion.source.channels);
        Self {
            fields: HeaderFields {
                rate_numerator: motion.source.rate.0,
                rate_denominator: motion.source.rate.1,
                ..fields(codec, &allocation.parameters, frames, count)
            },
            channels: channels.collect(),
            entry_frames: task.entry_frames,
            grid: codec.has_grids(),
        }
    }

    /// Whether a frame is at an entry point.
    pub fn is_entry(&self, frame: usize) -> bool {
        frame.is_multiple_of(self.entry_frames)
    }

    /// Runs the decoder's loop over `targets`, row-major words of the outline's channels.
    ///
    /// # Errors
    /// Where the outline is no valid header.
    pub fn simulate(&self, targets: &[i32], dead_zone: i32) -> Result<Coded, Error> {
        let bytes = header::emit(&self.fields, &self.channels, PRECISION, self.grid);
        let header = Header::parse(&bytes, Limits::MAX)?;
        let mut memory = OwnedMemory::new(header.needs());
        let mut decoder = match header.open(memory.lend())? {
            RunningCodec::Scalar(decoder) => decoder,
            #[allow(unreachable_patterns, reason = "all codecs of the list may be scalar")]
            _ => unreachable!("a scalar codec's decoder is the one that all scalar codecs share"),
        };
        let mut coded = Coded::default();
        coded.decoded.reserve(targets.len());
        for (frame, row) in targets.chunks_exact(self.channels.len()).enumerate() {
            let entry = self.is_entry(frame);
            let mut nearest = Nearest {
                targets: row,
                dead_zone,
                values: Vec::new(),
                codes: &mut coded.codes,
                wanted: &mut coded.wanted,
            };
            let pose = decoder.choose(&mut nearest, entry);
            coded.decoded.extend(pose.iter().map(|value| value.to_bits()));
            let values = nearest.values;
            if entry {
                coded.entries.push(values);
            }
        }
        Ok(coded)
    }
}

/// Chooses the code nearest to a target.
struct Nearest<'n> {
    targets: &'n [i32],
    /// As in [`Allocation`].
    dead_zone: i32,
    values: Vec<(i32, u32)>,
    codes: &'n mut Vec<i32>,
    wanted: &'n mut Vec<i32>,
}

impl Choose for Nearest<'_> {
    fn entry(&mut self, channel: usize, shift: u32, bits: u32) -> i32 {
        let most = (1i64 << bits >> 1) - 1;
        let rounded = (i64::from(self.targets[channel]) + ((1 << shift) >> 1)) >> shift;
        let value = rounded.clamp(!most, most) as i32;
        self.values.push((value, bits));
        value
    }

    fn code<Q: Quantise>(&mut self, channel: usize, predicted: i32, quantiser: &Q, state: &State) -> i32 {
        if state.bits() == 0 {
            return 0;
        }
        let mut difference = self.targets[channel].wrapping_sub(predicted);
        self.wanted.push(difference);
        if self.dead_zone > 0 {
            let by = (i64::from(quantiser.size(state.step())) * i64::from(self.dead_zone) / 64) as i32;
            difference -= difference.signum() * by.min(difference.saturating_abs());
        }
        let code = quantiser.nearest(difference, state.step(), state.bits());
        self.codes.push(code);
        code
    }
}
