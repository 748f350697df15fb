//! What scalar codecs share: those that have a code a channel and frame, whatever they predict and however they quantise.

pub(crate) mod byte_groups;
pub(crate) mod contract;
pub(crate) mod decoder;
pub(crate) mod initial;
pub(crate) mod linked;
pub(crate) mod loops;

pub use byte_groups::{Channels, GroupLoop};
pub use contract::ScalarCodec;
pub use decoder::ScalarDecoder;
pub use linked::LinkedScalar;
pub use loops::{Choose, Clock, Codes, Part};
