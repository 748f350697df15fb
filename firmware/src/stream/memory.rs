//! Memory that a live stream is lent.

use decoder_core::I16F16;

/// Memory of a live stream.
#[derive(Debug)]
pub struct Memory<'s> {
    /// For blocks that wait: each takes 12 bytes and the longest one's codes. The header is in front of them as long as the
    /// stream goes on.
    pub buffer: &'s mut [u8],
    /// For the decoder that plays it.
    pub player: PlayerMemory<'s>,
}

/// What a player of the stream needs, besides the memory of its decoder.
#[derive(Debug)]
pub struct PlayerMemory<'s> {
    /// For the header.
    pub header: &'s mut [u8],
    /// For the codes of the longest block, 12 bytes at least.
    pub block: &'s mut [u8],
    /// For concealment: four poses.
    pub poses: [&'s mut [I16F16]; 4],
}
