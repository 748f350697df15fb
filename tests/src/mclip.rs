//! The golden vectors of mclip, and both ways to decode them.

use crate::vectors::{LIMITS, Vector, hex, listed};
use decoder_core::mclip::{Clip, CodecId, Receiver, Stream};
use decoder_core::{Error, Limits};
use encoder::mclip::{Encoder, Encoding, Quality};
use encoder::memory::OwnedMemory;
use mocap::sample;
use sha2::{Digest, Sha256};

/// The list of vectors.
pub const LIST: &str = "SHA256SUMS.mclip";

/// The golden vectors.
///
/// # Panics
/// Where one cannot be read.
pub fn all() -> Vec<Vector> {
    listed(LIST)
}

/// The golden vectors, and with them the embedded sample as each codec encodes it, with hashes of what this machine
/// decodes.
///
/// # Panics
/// Where one cannot be read or decoded.
pub fn with_sample() -> Vec<Vector> {
    let mut vectors = all();
    let clip = sample::clip();
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap_or_else(|error| panic!("{error}"));
    for codec in CodecId::ALL {
        let encoded = encoder.encode(&Encoding::new(codec), Quality::Bits(5));
        let bytes = encoded.unwrap_or_else(|error| panic!("{codec:?}: {error}"));
        let sha256 = sha256_in_place(&bytes).unwrap_or_else(|error| panic!("{codec:?}: {error}"));
        vectors.push(Vector { name: format!("sample-{}.mclip", codec.name()), bytes, sha256 });
    }
    vectors
}

/// What decoders of the vectors, and of damaged ones, may hold.
pub const MCLIP_LIMITS: Limits = Limits { frames: 20_000, ..LIMITS };

/// SHA-256 of a clip's frames, decoded in place.
///
/// # Errors
/// Where the clip, or a block of it, is refused.
pub fn sha256_in_place(bytes: &[u8]) -> Result<String, Error> {
    let clip = Clip::parse(bytes, MCLIP_LIMITS)?;
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = clip.decoder(memory.lend())?;
    let mut sha = Sha256::new();
    while let Some(pose) = decoder.next_frame()? {
        pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
    }
    Ok(hex(sha))
}

/// SHA-256 of a clip's frames, decoded from chunks of `size` bytes.
///
/// # Errors
/// Where the clip, or a block of it, is refused.
pub fn sha256_of_stream(bytes: &[u8], size: usize) -> Result<String, Error> {
    let mut chunks = bytes.chunks(size);
    let mut chunk: &[u8] = &[];
    let mut buffer = vec![0; bytes.len()];
    let mut receiver = Receiver::new(&mut buffer);
    while !receiver.receive(&mut chunk)? {
        match chunks.next() {
            Some(next) => chunk = next,
            None => break,
        }
    }
    let header = receiver.finish(MCLIP_LIMITS)?;
    let mut memory = OwnedMemory::new(header.needs());
    let mut block = vec![0; usize::from(header.fields().block_bytes).max(12)];
    let mut stream = Stream::new(header, memory.lend(), &mut block)?;
    let mut sha = Sha256::new();
    loop {
        while let Some(pose) = stream.next_frame(&mut chunk)? {
            pose.iter().for_each(|value| sha.update(value.to_bits().to_le_bytes()));
        }
        match chunks.next() {
            Some(next) => chunk = next,
            None => break,
        }
    }
    stream.finish()?;
    Ok(hex(sha))
}
