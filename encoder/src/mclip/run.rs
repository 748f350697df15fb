//! The decoder's own loop, with codes that are chosen to come close to a motion.

use super::{Lent, writer};
use decoder_core::Limits;
use decoder_core::codec::RunningCodec;
use decoder_core::mclip::{Channel, Choose, Header, Opening, State};
use decoder_core::quantise::Quantise;

/// What a decoder will do: how its header begins, and the channels.
#[derive(Clone, Debug)]
pub(super) struct Plan<'p> {
    pub opening: Opening<'p>,
    pub channels: Vec<Channel<'p>>,
    /// Binary places of a step that values at an entry point are told apart to.
    pub precision: u8,
    /// Frames from one entry point to the next.
    pub entry_frames: usize,
    /// How much smaller than half a step a difference counts, in 64ths of a step: rounding towards zero makes
    /// codes smaller, and costs little where a step is coarse.
    pub dead: i32,
}

/// The codes of a motion, and what a decoder makes of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Coded {
    /// For each entry point, the values that it starts with and their bits.
    pub entries: Vec<Vec<(i32, u32)>>,
    /// Codes of all frames but those of entry points (pcm: of all frames), channels without bits left out.
    pub codes: Vec<i32>,
    /// For every code, the difference that it is to come near to.
    pub wanted: Vec<i32>,
    /// The decoded words, row-major.
    pub decoded: Vec<i32>,
}

impl Plan<'_> {
    /// Whether a frame is at an entry point.
    pub fn is_entry(&self, frame: usize) -> bool {
        frame.is_multiple_of(self.entry_frames)
    }

    /// Runs the loop over `targets`, row-major words of the plan's channels.
    ///
    /// # Panics
    /// If the plan is no valid header: a mistake of the encoder.
    pub fn run(&self, targets: &[i32]) -> Coded {
        let bytes = writer::header(&self.opening, &self.channels, self.precision);
        let header = match Header::parse(&bytes, Limits::MAX) {
            Ok(header) => header,
            Err(error) => panic!("the encoder planned a header that cannot be: {error}"),
        };
        let mut lent = Lent::new(header.needs());
        let mut decoder = match header.open(lent.memory()) {
            Ok(RunningCodec::Scalar(decoder)) => decoder,
            Err(error) => panic!("the encoder planned tables that cannot be: {error}"),
        };
        let mut coded = Coded::default();
        coded.decoded.reserve(targets.len());
        for (frame, row) in targets.chunks_exact(self.channels.len()).enumerate() {
            let entry = self.is_entry(frame);
            let mut nearest = Nearest {
                targets: row,
                dead: self.dead,
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
        coded
    }
}

/// Chooses the code nearest to a target.
struct Nearest<'n> {
    targets: &'n [i32],
    dead: i32,
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
        if self.dead > 0 {
            let by = (i64::from(quantiser.size(state.step())) * i64::from(self.dead) / 64) as i32;
            difference -= difference.signum() * by.min(difference.saturating_abs());
        }
        let code = quantiser.nearest(difference, state.step(), state.bits());
        self.codes.push(code);
        code
    }
}
