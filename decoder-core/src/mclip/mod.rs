//! `.mclip`: a clip in blocks with checksums, entry points and a header that says what a decoder needs.
//!
//! The bytes are in docs/FORMAT.md, "mclip". What is in a block is the [codec](crate::codec)'s: this container
//! knows codecs through [`LinkedCodec`](crate::codec::LinkedCodec) and [`FrameDecoder`](crate::codec::FrameDecoder) only.
//!
//! [`Clip`] is a clip in memory, read in place by [`Decoder`]. [`Stream`] is fed chunks of any size. Both hand whole
//! blocks to the same code, after their CRC-32 was checked, and give the same frames.
//!
//! A decoder's memory is lent by the caller: [`Header::needs`] says how much.

mod block;
mod bounds;
mod clip;
mod cursor;
mod decoder;
#[cfg(test)]
mod delayed;
mod entries;
mod fields;
mod header;
mod postcard;
mod record;
mod stream;

pub use crate::channel::{Channel, ChannelKind, MANTISSA_BITS, MAX_ENTRY_BITS, entry_shift};
pub use crate::codec::scalar::{Choose, ScalarDecoder};
pub use crate::ids::{CodecId, EntropyId};
pub use crate::memory::{Memory, Needs, Workspace};
pub use crate::state::State;
pub use block::{BLOCK_HEADER_BYTES, Block, BlockHeader, Blocks};
pub use bounds::BlockBounds;
pub use clip::Clip;
pub use decoder::{ClipDecoder, Decoder};
pub use entries::EntryPoint;
pub use fields::{HeaderFields, MAGIC, PREFIX_BYTES, Prefix, VERSION, checksum, digest};
pub use header::Header;
pub use record::{Packing, Packings, Records, emit_names, emit_records};
pub use stream::{BlockStream, Receiver, Stream};
