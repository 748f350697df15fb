//! What an entropy stage is to a decoder.

use super::symbols::SymbolSource;
use crate::error::Error;

/// An entropy stage of a clip, in memory that its caller lends.
pub trait Stage<'s>: Sized {
    /// Whether codes are of fixed width, eight channels from one whole byte to another.
    const BYTE_GROUPS: bool = false;

    /// Checks the tables of a header, which are in the structure at byte `at`; gives the number of their groups.
    ///
    /// # Errors
    /// [`Error::Encoding`] or [`Error::Malformed`] where they are none of the stage's.
    fn check(tables: &[u8], at: usize) -> Result<u8, Error>;

    /// The 16-bit words of memory that these tables need.
    fn halves(tables: &[u8]) -> usize;

    /// Builds what these tables say in memory of [`halves`](Self::halves) words.
    ///
    /// # Errors
    /// [`Error::Encoding`] or [`Error::Malformed`] where the tables are none.
    fn open(tables: &[u8], at: usize, halves: &'s mut [u16]) -> Result<Self, Error>;

    /// What is kept of a channel before its first code, which is of its group and of so many bits.
    fn context(&self, group: u8, bits: u8) -> u8;

    /// Begins anew at an entry point; `contexts` are what was kept of channels.
    fn restart<'c>(&mut self, contexts: impl Iterator<Item = &'c mut u8>);

    /// The bit where codes begin, where the values of an entry point end at bit `position`.
    fn codes_from(&self, position: usize) -> usize {
        position
    }

    /// Runs the loops of a frame that suit the stage; gives what they give.
    fn feed<L: FrameLoops>(&mut self, loops: L) -> Option<usize>;
}

/// The loops over a frame's channels, each for a kind of stage. They give the bit where the frame's codes end; `None` where
/// there are too few.
pub trait FrameLoops {
    /// With codes that a source gives one after the other.
    fn by_symbols<S: SymbolSource>(self, source: S) -> Option<usize>;

    /// With codes of fixed width, eight channels from one whole byte to another.
    fn by_byte_groups(self) -> Option<usize>;
}
