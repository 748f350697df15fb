//! The header of a clip (docs/FORMAT.md, "Header"): what the decoder's [`Header`] parses.

use decoder_core::bits::BitWriter;
use decoder_core::mclip::{Channel, Clip, Header, HeaderFields, emit_names, emit_records};
use decoder_core::{Error, Limits};

/// Most coefficients of predictors: the number of one is a byte.
const MOST_PREDICTORS: usize = 256;

/// Prefix, header and checksum. The memory that a decoder needs and the channels are filled in; the entry shifts of the
/// channels are those of `precision`, and `grid` is the codec's ([`Rules::grid`](decoder_core::Rules::grid)).
pub(crate) fn emit(
    fields: &HeaderFields<'_>,
    channels: &[Channel<'_>],
    precision: u8,
    grid: bool,
) -> Vec<u8> {
    let coefficients = if grid { Vec::new() } else { coefficients(channels) };
    let predictors: Vec<u8> = coefficients.iter().flat_map(|coefficient| coefficient.to_le_bytes()).collect();
    let mut records = BitWriter::new(Vec::new());
    emit_records(channels.iter().copied(), &coefficients, precision, grid, &mut records);
    let records = records.finish();
    let mut names = Vec::new();
    emit_names(channels.iter().copied(), &mut names);
    let fields =
        HeaderFields { predictors: &predictors, records: &records, names: &names, ram: u32::MAX, ..*fields };
    // A header that asks for all memory is valid, and says what it needs.
    let most = bytes(&fields);
    let ram = Header::parse(&most, Limits::MAX).map_or(u32::MAX, |header| header.needs().bytes() as u32);
    bytes(&HeaderFields { ram, ..fields })
}

fn bytes(fields: &HeaderFields<'_>) -> Vec<u8> {
    let mut bytes = Vec::new();
    fields.emit(&mut bytes);
    bytes
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

/// The clip with worst-case cycles of its frames in its header, each with the number of its core (docs/FORMAT.md, "Header"),
/// instead of those that it had.
///
/// # Errors
/// Where these bytes are no clip.
pub fn certify(clip: &[u8], cycles: &[(u8, u32)]) -> Result<Vec<u8>, Error> {
    let parsed = Clip::parse(clip, Limits::MAX)?;
    let entry = |&(core, cycles): &(u8, u32)| core::iter::once(core).chain(cycles.to_le_bytes());
    let cycles: Vec<u8> = cycles.iter().flat_map(entry).collect();
    let mut bytes = bytes(&HeaderFields { cycles: &cycles, ..*parsed.header().fields() });
    bytes.extend(clip.iter().skip(parsed.header_bytes()));
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::{ChannelKind, CodecId, EntropyId, entry_shift};

    const NAMES: [&str; 4] = ["", "root", "lfemur", "名"];

    fn fields(codec: CodecId, channels: usize) -> HeaderFields<'static> {
        HeaderFields {
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
        let bytes = emit(&fields(codec, channels.len()), channels, precision, codec == CodecId::Pcm);
        let header = Header::parse(&bytes, Limits::MAX).unwrap();
        assert_eq!(header.channels().collect::<Vec<_>>(), channels);
        bytes.len()
    }

    #[test]
    fn what_is_written_is_read() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut below = |end: u64| rng.u64(..end);
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
        let bytes = emit(&fields(CodecId::Dpcm, 400), &channels, 2, false);
        let header = Header::parse(&bytes, Limits::MAX).unwrap();
        let found: Vec<i16> = header.channels().map(|channel| channel.coefficient).collect();
        assert!((0..256).all(|index| found[index as usize] == 16_000 + index));
        assert!(found[256..].iter().all(|&alpha| alpha == 16_255));
    }
}
