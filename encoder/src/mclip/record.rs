//! The channels' part of a header: records in few bits, the predictors that they share, and the joints' names.

use crate::bits::BitWriter;
use decoder_core::arithmetic::unsigned;
use decoder_core::mclip::{Channel, MANTISSA_BITS, Packing};

/// Most coefficients: an index is a byte.
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
        let coefficients = if is_pcm { Vec::new() } else { coefficients(channels) };
        let index = |channel: &Channel<'_>| nearest(&coefficients, channel.coefficient);
        let active = || channels.iter().filter(|channel| channel.bits > 0);
        let bits = packing(channels.iter().map(|channel| channel.bits));
        let step = packing(channels.iter().map(|channel| channel.step));
        let entry_bits = packing(active().map(|channel| channel.entry_bits));
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
                append(&mut names, &channel.joint);
            }
            out.put(channel.kind.id().into(), 3);
            put(&mut out, bits, channel.bits);
            put(&mut out, step, channel.step);
            if channel.bits > 0 {
                put(&mut out, group, channel.group);
                if is_pcm {
                    out.put(channel.coefficient as u32, MANTISSA_BITS);
                } else {
                    put(&mut out, entry_bits, channel.entry_bits);
                    put(&mut out, predictor, index(channel));
                }
            }
            if channel.bits == 0 || is_pcm {
                number(&mut out, unsigned(channel.low >> channel.entry_shift));
            }
        }
        let predictors = coefficients.iter().flat_map(|coefficient| coefficient.to_le_bytes()).collect();
        Self { predictors, records: out.take(), names }
    }
}

/// The coefficients that there are; none where all are the last value.
fn coefficients(channels: &[Channel<'_>]) -> Vec<i16> {
    let active = channels.iter().filter(|channel| channel.bits > 0);
    let mut coefficients: Vec<i16> = active.map(|channel| channel.coefficient).collect();
    coefficients.sort_unstable();
    coefficients.dedup();
    coefficients.truncate(MOST_PREDICTORS);
    if coefficients == [0] { Vec::new() } else { coefficients }
}

/// The number of the coefficient that is nearest.
fn nearest(coefficients: &[i16], to: i16) -> u8 {
    (0..coefficients.len()).min_by_key(|&index| coefficients[index].abs_diff(to)).unwrap_or(0) as u8
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

/// Appends a value as postcard writes it.
pub(super) fn append(bytes: &mut Vec<u8>, value: &impl serde::Serialize) {
    match postcard::to_stdvec(value) {
        Ok(part) => bytes.extend(part),
        Err(error) => unreachable!("a vector grows: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::header;
    use super::*;
    use decoder_core::Limits;
    use decoder_core::mclip::{ChannelKind, CodecId, EntropyId, Header, Opening, entry_shift};

    const NAMES: [&str; 4] = ["", "root", "lfemur", "名"];

    fn opening(codec: CodecId, channels: usize) -> Opening<'static> {
        Opening {
            rate_numerator: 30,
            rate_denominator: 1,
            frames: 1,
            channels: channels as u16,
            block_bytes: 0,
            ram: 0,
            delay: 0,
            codec: codec.id(),
            entropy: EntropyId::FixedWidth.id(),
            parameters: if codec == CodecId::Pcm { &[] } else { &[2] },
            tables: &[],
            cycles: &[],
            predictors: &[],
            records: &[],
            names: &[],
        }
    }

    fn check(codec: CodecId, channels: &[Channel<'_>], precision: u8) -> usize {
        let bytes = header::emit(&opening(codec, channels.len()), channels, precision);
        let header = Header::parse(&bytes, Limits::MAX).unwrap();
        assert_eq!(header.channels().collect::<Vec<_>>(), channels);
        bytes.len()
    }

    #[test]
    fn what_is_written_is_read() {
        let mut state = 1u64;
        let mut below = |end: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % end
        };
        for round in 0..500 {
            let is_pcm = round % 5 == 0;
            let precision = below(16) as u8;
            let channels: Vec<Channel<'_>> = (0..=below(40))
                .map(|index| {
                    let step = below(if is_pcm { 16 } else { 200 }) as u8;
                    let bits = below(17) as u8;
                    let alpha = (below(300) as i16 * 100) - 15_000;
                    let mut channel = Channel {
                        joint: NAMES[(index as usize + round) % 4],
                        kind: ChannelKind::ALL[below(7) as usize],
                        low: 0,
                        entry_bits: if is_pcm || bits == 0 { 0 } else { 1 + below(32) as u8 },
                        entry_shift: entry_shift(step, precision, is_pcm),
                        bits,
                        step,
                        group: 0,
                        coefficient: match (bits, is_pcm) {
                            (0, _) => 0,
                            (_, true) => below(32768) as i16,
                            _ => alpha,
                        },
                    };
                    let low = below(1 << 32) as u32 as i32 >> below(32);
                    if bits == 0 || is_pcm {
                        channel.low = low >> channel.entry_shift << channel.entry_shift;
                    }
                    channel
                })
                .collect();
            check(if is_pcm { CodecId::Pcm } else { CodecId::Dpcm }, &channels, precision);
        }
    }

    #[test]
    fn what_channels_share_costs_nothing() {
        let channel = Channel {
            joint: "",
            kind: ChannelKind::Ry,
            low: 0,
            entry_bits: 9,
            entry_shift: 12,
            bits: 7,
            step: 88,
            group: 0,
            coefficient: 0,
        };
        let [few, many] = [1, 101].map(|count| check(CodecId::Dpcm, &vec![channel; count], 2));
        // First of a joint, and kind.
        assert_eq!(many - few, 51);
        let named = Channel { joint: "lfemur", ..channel };
        let three = check(CodecId::Dpcm, &[named, named, named], 2);
        assert_eq!(three - check(CodecId::Dpcm, &[channel; 3], 2), 7, "a joint is named once");
    }

    #[test]
    fn more_predictors_than_a_byte_can_number_become_the_nearest() {
        let channels: Vec<Channel<'_>> = (0..400)
            .map(|index| Channel {
                joint: "",
                kind: ChannelKind::Rx,
                low: 0,
                entry_bits: 1,
                entry_shift: 9,
                bits: 4,
                step: 64,
                group: 0,
                coefficient: 16_000 + index,
            })
            .collect();
        let bytes = header::emit(&opening(CodecId::Dpcm, 400), &channels, 2);
        let header = Header::parse(&bytes, Limits::MAX).unwrap();
        let found: Vec<i16> = header.channels().map(|channel| channel.coefficient).collect();
        assert!((0..256).all(|index| found[index as usize] == 16_000 + index));
        assert!(found[256..].iter().all(|&alpha| alpha == 16_255));
    }
}
