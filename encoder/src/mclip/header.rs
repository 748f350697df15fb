//! The header of a clip (docs/FORMAT.md, "Header"): what the decoder's [`Header`] parses.

use super::record::{Records, append};
use decoder_core::mclip::{Channel, Clip, CodecId, Header, MAGIC, Opening, VERSION, checksum};
use decoder_core::{Error, Limits};

/// Prefix, header and checksum. The memory that a decoder needs and the channels are filled in.
pub(crate) fn emit(opening: &Opening<'_>, channels: &[Channel<'_>], precision: u8) -> Vec<u8> {
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
    let mut body = Vec::new();
    append(&mut body, opening);
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend([0, 0]);
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(body);
    bytes.extend(checksum(&bytes, &[]).to_le_bytes());
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
