//! Quantisers: from the symbols of a channel to its values or differences, and back for the encoder.
//!
//! Source: the waveform-coding document, sections 7.2 and 7.3. One file a quantiser. What a clip fixes for all
//! channels is in the quantiser, what belongs to a channel is in its [`Cell`].

pub mod adaptive;
pub mod lookup;
pub mod mu_law;
pub mod step;
pub mod uniform;

pub use adaptive::Adaptive;
pub use lookup::Lookup;
pub use mu_law::MuLaw;
pub use uniform::{Grid, Uniform};

/// Most bits of a code.
pub const MAX_BITS: u8 = 16;

/// A channel's quantiser.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cell {
    /// Index of the step size ([`step::size`]).
    pub step: u8,
    /// Bits of a code, 0 to [`MAX_BITS`]; a channel of 0 bits keeps its value.
    pub bits: u8,
}

impl Cell {
    /// Symbols that the channel has: 2 to the power of its bits.
    pub const fn symbols(self) -> u32 {
        1u32.wrapping_shl(self.bits as u32)
    }
}

/// A quantiser of differences.
pub trait Quantise {
    /// The difference that `symbol` stands for. May change the cell, so it is called once a symbol.
    fn difference(&self, symbol: u32, cell: &mut Cell) -> i32;

    /// The symbol whose difference is nearest to `difference`, of those that the cell has. Only an encoder needs it.
    fn nearest(&self, difference: i32, cell: &Cell) -> u32;
}
