//! Static Huffman codes: canonical, limited in length, decoded by one look-up.
//!
//! A table has a code for each of the most frequent symbols and one escape, which is followed by the symbol in the
//! channel's own width. Codes are at most `index_bits` long, so that the next `index_bits` bits are an index that
//! finds symbol and length at once.
//!
//! Which table a symbol is read with depends on the channel's group and on its activity: how large its last codes
//! were. A channel at rest and one that moves have different statistics, and this tells them apart without a bit:
//!
//! - after every symbol of magnitude m (0, 1, 1, 2, 2 … for 0, 1, 2, 3, 4 …): `a ← a − ⌊a / 4⌋ + 8 · min(m, 7)`;
//! - a is in class 0, 1, … where it is at most [`CLASS_ENDS`]`[0]`, `[1]`, …; with c classes, the last one is all above.

use super::{Context, SymbolSource};
use crate::bits::BitReader;

/// Largest activity of each class but the last.
pub const CLASS_ENDS: [u8; MAX_CLASSES - 1] = [3, 10, 20, 36, 64, 100, 150];

/// Most classes.
pub const MAX_CLASSES: usize = 8;

/// Most bits of a code, and of the index.
pub const MAX_INDEX_BITS: u8 = 12;

/// Most groups of channels.
pub const MAX_GROUPS: u8 = 16;

/// Bytes before the first table's lengths.
const HEADER_BYTES: usize = 3;

/// In an entry: the code is the escape.
const ESCAPE: u16 = 1 << 15;

/// Why bytes are no set of tables: the byte that is wrong, from the start of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableError {
    /// They end early.
    Truncated {
        /// Where.
        at: usize,
    },
    /// A byte is out of its range.
    Range {
        /// Where it is.
        at: usize,
        /// What it is.
        found: u32,
        /// The lowest value that is allowed.
        low: u32,
        /// The highest.
        high: u32,
    },
    /// The codes of a table do not fill all of its index.
    Incomplete {
        /// The table's first byte.
        at: usize,
        /// The part that is filled, in entries; more than all where they overlap.
        filled: u32,
        /// All entries.
        entries: u32,
    },
    /// The memory lent is too small.
    Memory {
        /// Words that are needed.
        needed: usize,
    },
}

/// The shape of a set of tables: what its first three bytes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Bits of the index, 1 to [`MAX_INDEX_BITS`].
    pub index_bits: u8,
    /// Classes of activity, 1 to [`MAX_CLASSES`].
    pub classes: u8,
    /// Groups of channels, 1 to [`MAX_GROUPS`].
    pub groups: u8,
}

impl Shape {
    /// Reads the shape.
    ///
    /// # Errors
    /// [`TableError::Truncated`], [`TableError::Range`].
    pub fn read(bytes: &[u8]) -> Result<Self, TableError> {
        let [index_bits, classes, groups] =
            *bytes.first_chunk::<HEADER_BYTES>().ok_or(TableError::Truncated { at: bytes.len() })?;
        let highest = [MAX_INDEX_BITS, MAX_CLASSES as u8, MAX_GROUPS];
        for (at, (found, high)) in [index_bits, classes, groups].into_iter().zip(highest).enumerate() {
            if found == 0 || found > high {
                return Err(TableError::Range { at, found: found.into(), low: 1, high: high.into() });
            }
        }
        Ok(Self { index_bits, classes, groups })
    }

    /// Words of memory that the tables take: a 16-bit one for every index of every table.
    pub const fn words(self) -> usize {
        (self.classes as usize).wrapping_mul(self.groups as usize).wrapping_shl(self.index_bits as u32)
    }
}

/// Tables ready to decode with. Borrowed from the memory that they were built in.
#[derive(Clone, Copy, Debug)]
pub struct Huffman<'t> {
    shape: Shape,
    entries: &'t [u16],
}

impl<'t> Huffman<'t> {
    /// Builds the tables that `bytes` describe in `memory`, of at least [`Shape::words`] words.
    ///
    /// `bytes` are the shape's three, then for each group and in it for each class: n, then ⌈n/2⌉ bytes with the
    /// code lengths of n symbols, a nibble each, the low one first. The symbols are 0 to n − 2 and the escape;
    /// length 0 means no code. n = 0 is followed by one byte: the only symbol, with a code of no bits.
    /// Shorter codes are smaller numbers than longer ones, and among those of one length, codes ascend with the
    /// symbol, the escape last.
    ///
    /// # Errors
    /// [`TableError`] where `bytes` are no tables, or end before or go on after the last.
    pub fn build(bytes: &[u8], memory: &'t mut [u16]) -> Result<Self, TableError> {
        let shape = Shape::read(bytes)?;
        let needed = shape.words();
        let memory = memory.get_mut(..needed).ok_or(TableError::Memory { needed })?;
        let mut rest = bytes.get(HEADER_BYTES..).unwrap_or_default();
        for table in memory.chunks_exact_mut(1usize.wrapping_shl(u32::from(shape.index_bits))) {
            let at = bytes.len().saturating_sub(rest.len());
            let truncated = TableError::Truncated { at: bytes.len() };
            let (&count, after) = rest.split_first().ok_or(truncated)?;
            let length = if count == 0 { 1 } else { usize::from(count.div_ceil(2)) };
            let (lengths, after) = after.split_at_checked(length).ok_or(truncated)?;
            rest = after;
            if let ([symbol], 0) = (lengths, count) {
                table.fill(u16::from(*symbol));
            } else {
                fill(table, lengths, count, shape.index_bits, at)?;
            }
        }
        match rest.first() {
            None => Ok(Self { shape, entries: memory }),
            Some(&found) => {
                let at = bytes.len().saturating_sub(rest.len());
                Err(TableError::Range { at, found: found.into(), low: 0, high: 0 })
            }
        }
    }

    /// The shape of the tables.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// The number of the table that a channel's next symbol is read with.
    #[inline(always)]
    pub fn table(&self, context: Context) -> usize {
        let last = usize::from(self.shape.classes).wrapping_sub(1);
        let group = usize::from(context.group).wrapping_mul(usize::from(self.shape.classes));
        group.wrapping_add(class(context.activity).min(last))
    }
}

/// The class of an activity, of [`MAX_CLASSES`].
#[inline(always)]
pub const fn class(activity: u8) -> usize {
    let [e0, e1, e2, e3, e4, e5, e6] = CLASS_ENDS;
    // By halving: three comparisons.
    let (base, end) = if activity > e3 {
        if activity > e5 { (6, e6) } else { (4, e4) }
    } else if activity > e1 {
        (2, e2)
    } else {
        (0, e0)
    };
    base | (activity > end) as usize
}

/// The activity after a symbol.
#[inline(always)]
pub fn activity(before: u8, symbol: u32) -> u8 {
    // At most 243: a quarter is taken off before at most 56 are added.
    let magnitude = (symbol.wrapping_add(1) >> 1).min(7) as u8;
    before.wrapping_sub(before >> 2).wrapping_add(magnitude.wrapping_shl(3))
}

/// Fills a table by its code lengths: codes in their order take up the index without a gap.
fn fill(table: &mut [u16], lengths: &[u8], count: u8, index_bits: u8, at: usize) -> Result<(), TableError> {
    let entries = table.len();
    let escape = count.wrapping_sub(1);
    let mut filled = 0usize;
    for length in 1..=index_bits {
        let run = 1usize.wrapping_shl(u32::from(index_bits.wrapping_sub(length)));
        for symbol in 0..count {
            let byte = lengths.get(usize::from(symbol >> 1)).copied().unwrap_or(0);
            let found = if symbol & 1 == 0 { byte & 15 } else { byte >> 4 };
            if found > index_bits {
                let at = at.saturating_add(1).saturating_add(usize::from(symbol >> 1));
                return Err(TableError::Range { at, found: found.into(), low: 0, high: index_bits.into() });
            }
            if found != length {
                continue;
            }
            let end = filled.saturating_add(run);
            let flag = if symbol == escape { ESCAPE } else { 0 };
            let entry = flag | u16::from(length).wrapping_shl(8) | u16::from(symbol);
            if let Some(codes) = table.get_mut(filled..end) {
                codes.fill(entry);
            }
            filled = end;
        }
    }
    if filled == entries {
        return Ok(());
    }
    Err(TableError::Incomplete { at, filled: filled as u32, entries: entries as u32 })
}

impl SymbolSource for Huffman<'_> {
    #[inline(always)]
    fn symbol(&mut self, bits: &mut BitReader<'_>, width: u8, context: &mut Context) -> u32 {
        let index_bits = u32::from(self.shape.index_bits);
        let index = self.table(*context).wrapping_shl(index_bits) | bits.peek(index_bits) as usize;
        let entry = self.entries.get(index).copied().unwrap_or(0);
        bits.skip(u32::from(entry >> 8 & 15));
        let symbol = if entry & ESCAPE == 0 { u32::from(entry & 255) } else { bits.take(u32::from(width)) };
        context.activity = activity(context.activity, symbol);
        symbol
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, stride};
    use std::vec::Vec;

    /// Random complete code lengths for n symbols: leaves of a tree that is split until there are enough.
    fn lengths(random: &mut Random, n: usize, most: u8) -> Vec<u8> {
        let mut lengths = std::vec![1u8, 1];
        while lengths.len() < n {
            let leaf = random.below(lengths.len());
            if lengths[leaf] < most {
                lengths[leaf] += 1;
                lengths.push(lengths[leaf]);
            }
        }
        lengths
    }

    fn describe(index_bits: u8, classes: u8, groups: u8, tables: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = std::vec![index_bits, classes, groups];
        for lengths in tables {
            bytes.push(lengths.len() as u8);
            bytes.extend(lengths.chunks(2).map(|pair| pair[0] | pair.get(1).unwrap_or(&0) << 4));
        }
        bytes
    }

    /// Bit by bit: symbol and length of the code at the front of a window of 16 bits.
    fn bit_by_bit(lengths: &[u8], window: u16) -> (usize, u8) {
        let (mut code, mut first) = (0u32, 0u32);
        for length in 1..=15u8 {
            code = code << 1 | u32::from(window >> (16 - length) & 1);
            let of_length: Vec<usize> = (0..lengths.len()).filter(|&s| lengths[s] == length).collect();
            first <<= 1;
            if code < first + of_length.len() as u32 {
                return (of_length[(code - first) as usize], length);
            }
            first += of_length.len() as u32;
        }
        panic!("no code for {window:#b}");
    }

    #[test]
    fn every_window_of_sixteen_bits_of_every_table() {
        let mut random = Random(9);
        for (index_bits, n) in [(1, 2), (4, 9), (8, 2), (8, 40), (8, 255), (10, 60), (12, 100)] {
            let tables: Vec<Vec<u8>> = (0..3).map(|_| lengths(&mut random, n, index_bits)).collect();
            let bytes = describe(index_bits, 1, 3, &tables);
            let mut memory = std::vec![0; Shape::read(&bytes).unwrap().words()];
            let mut huffman = Huffman::build(&bytes, &mut memory).unwrap();
            for (group, lengths) in tables.iter().enumerate() {
                for window in (0..=u16::MAX).step_by(stride(32_003)) {
                    let data = [(window >> 8) as u8, window as u8, 0xa5];
                    let mut bits = BitReader::new(&data);
                    let mut context = Context { group: group as u8, activity: 0 };
                    let found = huffman.symbol(&mut bits, 5, &mut context);
                    let (symbol, length) = bit_by_bit(lengths, window);
                    let mut after = BitReader::at(&data, length.into());
                    let expected = if symbol == n - 1 { after.take(5) } else { symbol as u32 };
                    assert_eq!((found, bits.position()), (expected, after.position()), "{window:#018b}");
                }
            }
        }
    }

    #[test]
    fn a_lone_symbol_takes_no_bits() {
        let bytes = [8, 2, 1, 0, 3, 2, 0x11];
        let mut memory = [0; 512];
        let mut huffman = Huffman::build(&bytes, &mut memory).unwrap();
        let mut bits = BitReader::new(&[0b0100_0000]);
        let mut context = Context::default();
        assert_eq!(huffman.symbol(&mut bits, 4, &mut context), 3);
        assert_eq!((bits.position(), context.activity), (0, 16));
        // The other table: symbol 0, or the escape and four bits.
        assert_eq!(huffman.symbol(&mut bits, 4, &mut context), 0);
        assert_eq!((bits.position(), context.activity), (1, 12));
        assert_eq!(huffman.symbol(&mut bits, 4, &mut context), 0);
        assert_eq!(bits.position(), 6);
    }

    #[test]
    fn classes_and_activities_are_their_definition() {
        for before in 0..=243u8 {
            for symbol in (0..70_000u32).step_by(stride(8009)) {
                let magnitude = symbol.div_ceil(2).min(7);
                let expected = u32::from(before) - u32::from(before) / 4 + 8 * magnitude;
                assert_eq!(u32::from(activity(before, symbol)), expected);
                assert!(expected <= 243);
            }
        }
        for a in 0..=255u8 {
            let expected = CLASS_ENDS.iter().position(|&end| a <= end).unwrap_or(MAX_CLASSES - 1);
            assert_eq!(class(a), expected);
        }
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_place() {
        let mut memory = [0; 1024];
        let mut error = |bytes: &[u8]| Huffman::build(bytes, &mut memory).unwrap_err();
        assert_eq!(error(&[8, 1]), TableError::Truncated { at: 2 });
        assert_eq!(error(&[0, 1, 1]), TableError::Range { at: 0, found: 0, low: 1, high: 12 });
        assert_eq!(error(&[8, 9, 1]), TableError::Range { at: 1, found: 9, low: 1, high: 8 });
        assert_eq!(error(&[8, 1, 17]), TableError::Range { at: 2, found: 17, low: 1, high: 16 });
        assert_eq!(error(&[8, 1, 1]), TableError::Truncated { at: 3 });
        assert_eq!(error(&[8, 1, 1, 0]), TableError::Truncated { at: 4 });
        assert_eq!(error(&[8, 1, 1, 3, 0x21]), TableError::Truncated { at: 5 });
        assert_eq!(error(&[4, 1, 1, 2, 0x51]), TableError::Range { at: 4, found: 5, low: 0, high: 4 });
        assert_eq!(error(&[8, 1, 1, 2, 0x21]), TableError::Incomplete { at: 3, filled: 192, entries: 256 });
        assert_eq!(
            error(&[8, 1, 1, 3, 0x11, 1]),
            TableError::Incomplete { at: 3, filled: 384, entries: 256 }
        );
        assert_eq!(error(&[8, 1, 1, 2, 0x11, 7]), TableError::Range { at: 5, found: 7, low: 0, high: 0 });
        assert_eq!(error(&[12, 1, 1, 2, 0x11]), TableError::Memory { needed: 4096 });
    }
}
