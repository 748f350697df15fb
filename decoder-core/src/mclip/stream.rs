//! Plays a clip that arrives in chunks of any size: first its header, then block by block.

use super::block::{BLOCK_HEADER_BYTES, BlockHeader};
use super::cursor::{BlockCursor, Missing, has_poses_left};
use super::fields::{PREFIX_BYTES, Prefix};
use super::header::Header;
use crate::codec::contract::FrameDecoder;
use crate::codec::linked::RunningCodec;
use crate::error::{Error, Field, Limits};
use crate::memory::{Memory, front};
use fixed::types::I16F16;

/// A header that is being received.
#[derive(Debug)]
pub struct Receiver<'h> {
    buffer: &'h mut [u8],
    filled: usize,
}

impl<'h> Receiver<'h> {
    /// A receiver before the first byte. `buffer` takes prefix, header and checksum.
    pub const fn new(buffer: &'h mut [u8]) -> Self {
        Self { buffer, filled: 0 }
    }

    /// Takes bytes off the front of `chunk` until the header is whole; then gives true, and leaves the rest.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`] where the buffer is smaller than the header, and as [`Prefix::read`].
    pub fn receive(&mut self, chunk: &mut &[u8]) -> Result<bool, Error> {
        if !fill(self.buffer, &mut self.filled, chunk, PREFIX_BYTES, Field::Header)? {
            return Ok(false);
        }
        let needed = Prefix::read(self.buffer)?.header_bytes;
        fill(self.buffer, &mut self.filled, chunk, needed, Field::Header)
    }

    /// The header, once it is whole.
    ///
    /// # Errors
    /// As [`Header::parse`].
    pub fn finish(self, limits: Limits) -> Result<Header<'h>, Error> {
        let buffer: &'h [u8] = self.buffer;
        Header::parse(buffer.get(..self.filled).unwrap_or_default(), limits)
    }
}

/// The blocks of a clip that is being received.
pub type Stream<'a, 's> = BlockStream<'a, 's, RunningCodec<'a, 's>>;

/// The blocks of a clip that is being received, and a codec's decoder for them.
#[derive(Debug)]
pub struct BlockStream<'a, 's, D> {
    header: Header<'a>,
    decoder: D,
    buffer: &'s mut [u8],
    filled: usize,
    expect: Expect,
    /// Number of the frame whose codes come next.
    frame: u32,
    missing: Missing,
    /// Where the next block's header is, as far as bytes were not lost.
    at: usize,
}

#[derive(Clone, Copy, Debug)]
enum Expect {
    /// A block's header; after a loss, that of any entry point.
    Header { resuming: bool },
    /// The codes of a block.
    Codes { block: BlockHeader },
    /// Nothing before the frames of this block were given; `codes` bytes of the buffer are its.
    Frames { cursor: BlockCursor, codes: usize },
    /// Codes of a block that is skipped after a loss.
    Skip { left: usize },
    /// After an error, which is repeated until [`Stream::resume`].
    Nothing { because: Error },
}

impl<'a, 's> Stream<'a, 's> {
    /// A stream before its first block. `buffer` takes the codes of the longest block, and 12 bytes at least.
    ///
    /// # Errors
    /// [`Error::OutputTooSmall`], or [`Error::Encoding`] where the code tables are none.
    pub fn new(header: Header<'a>, memory: Memory<'s>, buffer: &'s mut [u8]) -> Result<Self, Error> {
        let decoder = header.open(memory)?;
        Self::with_decoder(header, decoder, buffer)
    }
}

impl<'a, 's, D: FrameDecoder> BlockStream<'a, 's, D> {
    pub(super) fn with_decoder(header: Header<'a>, decoder: D, buffer: &'s mut [u8]) -> Result<Self, Error> {
        let needed = usize::from(header.fields().block_bytes).max(BLOCK_HEADER_BYTES);
        let buffer = front(buffer, needed, Field::Payload)?;
        let (expect, missing) = (Expect::Header { resuming: false }, Missing::at_entry(&decoder));
        Ok(Self { header, decoder, buffer, filled: 0, expect, frame: 0, missing, at: 0 })
    }

    /// Takes bytes off the front of `chunk` until a frame is whole and returns its pose; `None` once all of `chunk`
    /// was taken. Call it again with the rest: a block has many frames.
    ///
    /// Bytes in errors count from the first block.
    ///
    /// # Errors
    /// As [`Decoder::next_frame`](super::ClipDecoder::next_frame), and [`Error::Encoding`] where bytes follow the last
    /// frame. After an error the stream repeats it, up to [`resume`](Self::resume).
    pub fn next_frame(&mut self, chunk: &mut &[u8]) -> Result<Option<&[I16F16]>, Error> {
        match self.advance(chunk) {
            Ok(true) => Ok(Some(self.decoder.pose())),
            Ok(false) => Ok(None),
            Err(because) => {
                self.expect = Expect::Nothing { because };
                Err(because)
            }
        }
    }

    fn advance(&mut self, chunk: &mut &[u8]) -> Result<bool, Error> {
        loop {
            match &mut self.expect {
                Expect::Nothing { because } => return Err(*because),
                Expect::Header { resuming } => {
                    let resuming = *resuming;
                    let frames = self.header.frames();
                    if self.frame >= frames && !resuming {
                        if has_poses_left(&self.decoder, self.frame, frames) {
                            self.decoder.drain();
                            self.frame = self.frame.saturating_add(1);
                            if self.missing.hides_pose(&self.decoder) {
                                continue;
                            }
                            return Ok(true);
                        }
                        if chunk.is_empty() {
                            return Ok(false);
                        }
                        return Err(Error::Encoding { field: Field::BlockHeader, at: self.at });
                    }
                    if !fill(self.buffer, &mut self.filled, chunk, BLOCK_HEADER_BYTES, Field::Payload)? {
                        return Ok(false);
                    }
                    self.filled = 0;
                    let Some(bytes) = self.buffer.first_chunk() else { return Ok(false) };
                    let expected = (!resuming).then_some(self.frame);
                    let block = BlockHeader::read(bytes, self.at, self.header.block_bounds(), expected)?;
                    if resuming && block.entry {
                        self.missing = Missing::at_entry(&self.decoder);
                    }
                    self.expect = if resuming && !block.entry {
                        Expect::Skip { left: block.length.into() }
                    } else {
                        Expect::Codes { block }
                    };
                }
                Expect::Skip { left } => {
                    let skipped = chunk.len().min(*left);
                    *chunk = chunk.get(skipped..).unwrap_or_default();
                    *left = left.saturating_sub(skipped);
                    if *left > 0 {
                        return Ok(false);
                    }
                    self.expect = Expect::Header { resuming: true };
                }
                Expect::Codes { block } => {
                    let (block, codes) = (*block, usize::from(block.length));
                    if !fill(self.buffer, &mut self.filled, chunk, codes, Field::Payload)? {
                        return Ok(false);
                    }
                    block.verify(self.buffer.get(..codes).unwrap_or_default(), self.at)?;
                    self.frame = block.first_frame;
                    self.filled = 0;
                    self.expect = Expect::Frames { cursor: BlockCursor::new(block, self.at), codes };
                }
                Expect::Frames { cursor, codes } => {
                    let bytes = self.buffer.get(..*codes).unwrap_or_default();
                    if cursor.next_plain(&mut self.decoder, bytes)?
                        || cursor.next(&mut self.decoder, bytes)?
                    {
                        self.frame = self.frame.saturating_add(1);
                        if self.missing.hides_pose(&self.decoder) {
                            continue;
                        }
                        return Ok(true);
                    }
                    self.at = self.at.saturating_add(BLOCK_HEADER_BYTES).saturating_add(*codes);
                    self.expect = Expect::Header { resuming: false };
                }
            }
        }
    }

    /// Goes on after a loss: the next byte is that of a block's header, and blocks are skipped up to an entry point.
    pub const fn resume(&mut self) {
        self.filled = 0;
        self.expect = Expect::Header { resuming: true };
    }

    /// Says whether the last frame was given.
    ///
    /// # Errors
    /// [`Error::Truncated`] where it was not, or the stream's earlier error.
    pub const fn finish(&self) -> Result<(), Error> {
        match self.expect {
            Expect::Nothing { because } => Err(because),
            _ if self.frame >= self.header.frames() => Ok(()),
            Expect::Header { .. } | Expect::Skip { .. } | Expect::Frames { .. } => Err(Error::Truncated {
                field: Field::BlockHeader,
                at: self.at,
                needed: BLOCK_HEADER_BYTES,
                found: self.filled,
            }),
            Expect::Codes { block } => Err(Error::Truncated {
                field: Field::Payload,
                at: self.at,
                needed: block.length as usize,
                found: self.filled,
            }),
        }
    }

    /// Number of the frame that comes next.
    pub fn position(&self) -> u32 {
        self.missing.position(&self.decoder, self.frame)
    }

    /// The header.
    pub const fn header(&self) -> &Header<'a> {
        &self.header
    }
}

/// Takes bytes off the front of `chunk` until the buffer holds `needed`; gives whether it does.
fn fill(
    buffer: &mut [u8],
    filled: &mut usize,
    chunk: &mut &[u8],
    needed: usize,
    field: Field,
) -> Result<bool, Error> {
    if *filled >= needed {
        return Ok(true);
    }
    let lent = buffer.len();
    let free = buffer.get_mut(*filled..needed).ok_or(Error::OutputTooSmall { field, needed, lent })?;
    let count = free.len().min(chunk.len());
    let (taken, rest) = chunk.split_at_checked(count).unwrap_or((&[], &[]));
    free.iter_mut().zip(taken).for_each(|(slot, &byte)| *slot = byte);
    *chunk = rest;
    *filled = filled.saturating_add(count);
    Ok(*filled >= needed)
}
