//! `.mclip`: a clip in blocks with checksums, entry points and a header that says what a decoder needs.
//!
//! The bytes are in docs/FORMAT.md, "mclip". A codec is a composition of the crate's stages; [`Codec`] lists them,
//! and each has a file here that composes it.
//!
//! [`Clip`] is a clip in memory, read in place by [`Decoder`]. [`Stream`] is fed chunks of any size. Both hand whole
//! blocks to the same code, after their CRC-32 was checked, and give the same frames.
//!
//! A decoder's memory is lent by the caller: [`Header::needs`] says how much.

mod block;
mod channels;
mod clip;
mod codec;
mod cursor;
mod decoder;
mod engine;
mod header;
mod octets;
mod record;
mod state;
mod stream;
mod workspace;

pub use block::{BLOCK_HEADER_BYTES, BlockHeader};
pub use channels::Choose;
pub use clip::Clip;
pub use codec::{Adaptation, Adpcm, Codec, CodecId, EntropyId};
pub use decoder::Decoder;
pub use engine::{Engine, Memory, Needs};
pub use header::{Header, MAGIC, Opening, PREFIX_BYTES, Prefix, VERSION, checksum, digest};
pub use record::{
    Channel, ChannelKind, Channels, MANTISSA_BITS, MAX_ENTRY_BITS, Packing, Packings, entry_shift,
};
pub use state::State;
pub use stream::{Receiver, Stream};
pub use workspace::Workspace;
