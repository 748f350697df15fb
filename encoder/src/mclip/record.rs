//! The channels' part of a header: records in few bits, the predictors that they share, and the joints' names.

use super::bits::BitWriter;
use decoder_core::arithmetic::unsigned;
use decoder_core::mclip::{Channel, MANTISSA_BITS, Packing};
use decoder_core::predict::ONE;

/// Most pairs of coefficients: an index is a byte.
const MOST_PREDICTORS: usize = 256;

/// The parts of a header that say what its channels are.
#[derive(Clone, Debug, Default)]
pub(super) struct Records {
    pub predictors: Vec<u8>,
    pub records: Vec<u8>,
    pub names: Vec<u8>,
}

impl Records {
    /// The records of these channels, whose entry shifts are those of `precision`.
    pub fn of(channels: &[Channel<'_>], precision: u8, is_pcm: bool) -> Self {
        let pairs = if is_pcm { Vec::new() } else { pairs(channels) };
        let index = |channel: &Channel<'_>| nearest(&pairs, channel.coefficients);
        let active = || channels.iter().filter(|channel| channel.bits > 0);
        let bits = packing(channels.iter().map(|channel| channel.bits));
        let step = packing(channels.iter().map(|channel| channel.step));
        let entry_bits = packing(channels.iter().map(|channel| channel.entry_bits));
        let group = packing(active().map(|channel| channel.group));
        let predictor = packing(active().map(index));
        let mut out = BitWriter::default();
        out.put(precision.into(), 4);
        for packing in [bits, step, entry_bits, group, predictor] {
            out.put(packing.least.into(), 8);
            out.put(packing.width.into(), 4);
        }
        let put = |out: &mut BitWriter, packing: Packing, value: u8| {
            out.put(u32::from(value - packing.least), packing.width.into());
        };
        let mut names = Vec::new();
        let mut before = None;
        let has_names = channels.iter().any(|channel| !channel.joint.is_empty());
        for channel in channels {
            let is_first = before.replace(channel.joint) != Some(channel.joint);
            out.put(is_first.into(), 1);
            if is_first && has_names {
                super::writer::append(&mut names, &channel.joint);
            }
            out.put(channel.kind.id().into(), 3);
            put(&mut out, bits, channel.bits);
            put(&mut out, step, channel.step);
            put(&mut out, entry_bits, channel.entry_bits);
            if channel.bits > 0 {
                put(&mut out, group, channel.group);
                if is_pcm {
                    out.put(channel.coefficients[0] as u32, MANTISSA_BITS);
                } else {
                    put(&mut out, predictor, index(channel));
                }
            }
            number(&mut out, unsigned(channel.low.checked_shr(channel.low_shift()).unwrap_or(0)));
        }
        let predictors = pairs.iter().flatten().flat_map(|part| part.to_le_bytes()).collect();
        Self { predictors, records: out.take(), names }
    }
}

/// The pairs of coefficients that there are; none where all are the last value.
fn pairs(channels: &[Channel<'_>]) -> Vec<[i16; 2]> {
    let mut pairs: Vec<[i16; 2]> =
        channels.iter().filter(|channel| channel.bits > 0).map(|channel| channel.coefficients).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs.truncate(MOST_PREDICTORS);
    if pairs == [[ONE, 0]] { Vec::new() } else { pairs }
}

/// The number of the pair that is nearest.
fn nearest(pairs: &[[i16; 2]], to: [i16; 2]) -> u8 {
    let off = |pair: &[i16; 2]| pair.iter().zip(to).map(|(a, b)| u32::from(a.abs_diff(b))).sum::<u32>();
    (0..pairs.len()).min_by_key(|&index| off(&pairs[index])).unwrap_or(0) as u8
}

/// The narrowest packing that has room for these values.
fn packing(values: impl Iterator<Item = u8> + Clone) -> Packing {
    let least = values.clone().min().unwrap_or(0);
    let most = values.max().unwrap_or(0);
    let width = (8 - (most - least).leading_zeros()) as u8;
    // Down where the highest sum would not be a byte.
    Packing { least: u32::from(least).min(256 - (1 << width)) as u8, width }
}

/// Three bits at a time, the lowest first, with a bit before them that says whether more follow.
fn number(out: &mut BitWriter, mut value: u32) {
    loop {
        let rest = value >> 3;
        out.put(value & 7 | if rest > 0 { 8 } else { 0 }, 4);
        value = rest;
        if value == 0 {
            return;
        }
    }
}
