//! Codecs: what of the crate's stages each is composed of, one file a codec, and the one list of them.
//!
//! | codec | prediction | quantiser |
//! |---|---|---|
//! | [pcm] | the middle of the channel's range | uniform between limits (7-4) |
//! | [mulaw] | first order | mu-law (7-5) |
//! | [dpcm] | the last value, first or second order | uniform |
//! | [adpcm] | second order, fixed or adaptive | uniform or adaptive (7-7) |
//! | [qmd] | the last value | look-up table |
//!
//! Containers know codecs as [`LinkedCodec`] and [`RunningCodec`], which the list makes. A codec is added by a file here, a
//! line of the list, a section of docs/FORMAT.md, and an encoder.

pub mod contract;
pub(crate) mod linked;
pub(crate) mod list;
pub mod scalar;

macro_rules! modules {
    (
        scalar { $($(#[$doc:meta])* $id:literal $Variant:ident($module:ident $(<$life:lifetime>)?) $name:literal [$($part:literal),*];)* }
        other { $($(#[$other_doc:meta])* $other_id:literal $Other:ident($other:ident $(<$other_life:lifetime>)?) $other_name:literal [$($other_part:literal),*];)* }
    ) => {
        $(pub mod $module;)*
        $(pub mod $other;)*
    };
}

list::for_each_codec!(modules);

pub use crate::ids::CodecId;
pub use contract::{Codec, CodecWithDecoder, FrameDecoder, Shape};
pub use linked::{LinkedCodec, RunningCodec};
