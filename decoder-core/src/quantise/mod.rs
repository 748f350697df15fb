//! Quantisers: from the codes of a channel to its values or differences, and back for the encoder.
//!
//! Source: the waveform-coding document, sections 7.2 and 7.3. One file a quantiser. What a clip fixes for all
//! channels is in the quantiser, what belongs to a channel is given to it.

pub mod adaptive;
pub mod lookup;
pub mod mu_law;
pub mod quantiser;
pub mod step;
pub mod uniform;

pub use adaptive::Adaptive;
pub use lookup::Lookup;
pub use mu_law::MuLaw;
pub use quantiser::{MAX_BITS, Quantise, Step};
pub use uniform::{Grid, Uniform};
