//! Static Huffman codes: canonical, limited to eight bits, decoded by one look-up.
//!
//! A table has a prefix code for each of the most frequent symbols and one escape, which is followed by the code in the
//! channel's own width. The next eight bits are an index that finds everything at once: the code, its length, and the
//! table that the channel's next code is read with.
//!
//! Each group of channels has tables of its own, one for each class of activity: how large the channel's last codes
//! were. A channel at rest and one that moves have different statistics, and this tells them apart without a bit:
//!
//! - a channel is in class 0 at first;
//! - a code c has level l, the number of the [`LEVEL_ENDS`] that |c| is above, or the highest class if that is lower;
//! - from class k it goes to l or to k − 1, whichever is higher.
//!
//! So classes follow a movement that begins at once, and one that ends slowly.

use super::stage::{FrameLoops, Stage};
use super::symbols::SymbolSource;
use crate::arithmetic::signed;
use crate::bits::BitReader;
use crate::error::{Error, Field};
use core::hint::cold_path;

/// Largest |c| of each level but the last.
pub const LEVEL_ENDS: [u32; 7] = [0, 1, 2, 3, 5, 8, 13];

/// Bits of the index, and most bits of a prefix code.
pub const INDEX_BITS: u8 = 8;

/// Indices of a table.
const INDICES: usize = 1 << INDEX_BITS;

/// Most tables, of all groups together.
pub const MAX_TABLES: u8 = 8;

/// In a channel's context: it has no codes.
pub const NO_TABLE: u8 = u8::MAX;

/// Bytes before the first table's lengths.
const HEADER_BYTES: usize = 2;

/// An index's entry has the number of the next table in its upper three bits, the code in the eight below, and in the
/// last four the length. This is set besides where the code is the escape, whose own upper bits do not count: no
/// [`BitReader`] holds as many bits to spare as such a length takes, so that one test finds escapes too.
const ESCAPE: u16 = 1 << 4;

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
    /// They go on after the last table.
    TooLong {
        /// Bytes of the tables.
        used: usize,
        /// Bytes that are there.
        found: usize,
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

/// The shape of a set of tables: what its first two bytes say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Classes of activity, at least 1.
    pub classes: u8,
    /// Groups of channels, at least 1; groups times classes are at most [`MAX_TABLES`].
    pub groups: u8,
}

impl Shape {
    /// Reads the shape.
    ///
    /// # Errors
    /// [`TableError::Truncated`], [`TableError::Range`].
    pub fn read(bytes: &[u8]) -> Result<Self, TableError> {
        let [classes, groups] =
            *bytes.first_chunk::<HEADER_BYTES>().ok_or(TableError::Truncated { at: bytes.len() })?;
        let most = MAX_TABLES.checked_div(classes).unwrap_or(0);
        for (at, found, high) in [(0, classes, MAX_TABLES), (1, groups, most)] {
            if found == 0 || found > high {
                return Err(TableError::Range { at, found: found.into(), low: 1, high: high.into() });
            }
        }
        Ok(Self { classes, groups })
    }

    /// Words of memory that the tables take: a 16-bit one for every index of every table.
    pub const fn words(self) -> usize {
        (self.classes as usize).wrapping_mul(self.groups as usize).wrapping_mul(INDICES)
    }

    /// The table that the first code of a channel of this group is read with.
    pub const fn first_table(self, group: u8) -> u8 {
        self.classes.wrapping_mul(group)
    }

    /// The table that the first code of a channel is read with, of which a later one is read with `table`;
    /// [`NO_TABLE`] stays.
    pub fn first_of(self, table: u8) -> u8 {
        if table == NO_TABLE {
            return NO_TABLE;
        }
        // Most clips have one group: no division.
        if self.groups == 1 { 0 } else { table.wrapping_sub(self.class_of(table)) }
    }

    fn class_of(self, table: u8) -> u8 {
        table.checked_rem(self.classes).unwrap_or(0)
    }

    /// The table that follows `table` after a code.
    #[inline(never)]
    pub fn next_table(self, table: u8, code: i32) -> u8 {
        let class = self.class_of(table);
        table.wrapping_sub(class).wrapping_add(next_class(class, code, self.classes))
    }
}

/// The class, of `classes`, that a channel is in after a code.
fn next_class(class: u8, code: i32, classes: u8) -> u8 {
    let magnitude = code.unsigned_abs();
    let level = LEVEL_ENDS.iter().fold(0u8, |level, &end| level.wrapping_add((magnitude > end).into()));
    let level = level.min(classes.wrapping_sub(1));
    level.max(class.saturating_sub(1))
}

/// Tables ready to decode with. Borrowed from the memory that they were built in.
#[derive(Clone, Copy, Debug)]
pub struct Huffman<'t> {
    shape: Shape,
    tables: &'t [[u16; INDICES]],
}

impl<'t> Huffman<'t> {
    /// Builds the tables that `bytes` describe in `memory`, of at least [`Shape::words`] words.
    ///
    /// `bytes` are the shape's two, then for each group and in it for each class: n, then ⌈n/2⌉ bytes with the
    /// code lengths of n symbols, a nibble each, the low one first. The symbols are 0 to n − 2 (codes 0, −1, 1, −2 …) and
    /// the escape; length 0 means no code. n = 0 is followed by one byte: the only symbol, with a code of no bits.
    /// Shorter codes are smaller numbers than longer ones, and among those of one length, codes ascend with the
    /// symbol, the escape last.
    ///
    /// # Errors
    /// [`TableError`] where `bytes` are no tables, or end before or go on after the last.
    pub fn build(bytes: &[u8], memory: &'t mut [u16]) -> Result<Self, TableError> {
        let shape = Shape::read(bytes)?;
        let needed = shape.words();
        let memory = memory.get_mut(..needed).ok_or(TableError::Memory { needed })?;
        let (tables, _) = memory.as_chunks_mut::<INDICES>();
        let mut rest = bytes.get(HEADER_BYTES..).unwrap_or_default();
        let mut number = 0u8;
        for table in tables.iter_mut() {
            let at = bytes.len().saturating_sub(rest.len());
            let truncated = TableError::Truncated { at: bytes.len() };
            let (&count, after) = rest.split_first().ok_or(truncated)?;
            let length = if count == 0 { 1 } else { usize::from(count.div_ceil(2)) };
            let (lengths, after) = after.split_at_checked(length).ok_or(truncated)?;
            rest = after;
            if let ([symbol], 0) = (lengths, count) {
                table.fill(entry(shape, number, *symbol, 0));
            } else {
                fill(table, lengths, count, at, |symbol, length| entry(shape, number, symbol, length))?;
            }
            number = number.wrapping_add(1);
        }
        match rest.first() {
            None => Ok(Self { shape, tables }),
            Some(_) => {
                let used = bytes.len().saturating_sub(rest.len());
                Err(TableError::TooLong { used, found: bytes.len() })
            }
        }
    }

    /// The shape of the tables.
    pub const fn shape(&self) -> Shape {
        self.shape
    }
}

/// The entry of a symbol in a table.
fn entry(shape: Shape, table: u8, symbol: u8, length: u8) -> u16 {
    let code = signed(symbol.into());
    let next = u16::from(shape.next_table(table, code));
    next.wrapping_shl(13) | u16::from(code as u8).wrapping_shl(5) | u16::from(length)
}

/// Fills a table by its code lengths: codes in their order take up the index without a gap.
fn fill(
    table: &mut [u16; INDICES],
    lengths: &[u8],
    count: u8,
    at: usize,
    entry: impl Fn(u8, u8) -> u16,
) -> Result<(), TableError> {
    let entries = table.len();
    let escape = count.wrapping_sub(1);
    let mut filled = 0usize;
    for length in 1..=INDEX_BITS {
        let run = 1usize.wrapping_shl(u32::from(INDEX_BITS.wrapping_sub(length)));
        for symbol in 0..count {
            let byte = lengths.get(usize::from(symbol >> 1)).copied().unwrap_or(0);
            let found = if symbol & 1 == 0 { byte & 15 } else { byte >> 4 };
            if found > INDEX_BITS {
                let at = at.saturating_add(1).saturating_add(usize::from(symbol >> 1));
                return Err(TableError::Range { at, found: found.into(), low: 0, high: INDEX_BITS.into() });
            }
            if found != length {
                continue;
            }
            let end = filled.saturating_add(run);
            let flag = if symbol == escape { ESCAPE } else { 0 };
            if let Some(codes) = table.get_mut(filled..end) {
                codes.fill(flag | entry(symbol, length));
            }
            filled = end;
        }
    }
    if filled == entries {
        return Ok(());
    }
    Err(TableError::Incomplete { at, filled: filled as u32, entries: entries as u32 })
}

impl<'s> Stage<'s> for Huffman<'s> {
    fn check(tables: &[u8], at: usize) -> Result<u8, Error> {
        let none = Error::Encoding { field: Field::CodeTables, at };
        Shape::read(tables).map(|shape| shape.groups).map_err(|_| none)
    }

    fn halves(tables: &[u8]) -> usize {
        Shape::read(tables).map_or(0, Shape::words)
    }

    fn open(tables: &[u8], at: usize, halves: &'s mut [u16]) -> Result<Self, Error> {
        Self::build(tables, halves).map_err(|error| match error {
            TableError::Range { found, low, high, .. } => {
                Error::Malformed { field: Field::CodeTables, at, found, low, high }
            }
            TableError::TooLong { used, found } => {
                let (used, found) = (used as u32, found as u32);
                Error::Malformed { field: Field::CodeTables, at, found, low: used, high: used }
            }
            _ => Error::Encoding { field: Field::CodeTables, at },
        })
    }

    fn context(&self, group: u8, bits: u8) -> u8 {
        if bits == 0 { NO_TABLE } else { self.shape.first_table(group) }
    }

    #[inline(always)]
    fn restart<'c>(&mut self, contexts: impl Iterator<Item = &'c mut u8>) {
        contexts.for_each(|context| *context = self.shape.first_of(*context));
    }

    #[inline(always)]
    fn feed<L: FrameLoops>(&mut self, loops: L) -> Option<usize> {
        loops.by_symbols(*self)
    }
}

impl SymbolSource for Huffman<'_> {
    /// `context` is the number of the table that the code is read with.
    #[inline(always)]
    fn code(&mut self, bits: &mut BitReader<'_>, width: u8, context: &mut u8) -> i32 {
        let Some(table) = self.tables.get(usize::from(*context)) else { return 0 };
        let entry = table.get(usize::from(bits.peek_byte())).copied().unwrap_or(0);
        let mut taken = bits.clone();
        if !taken.skip_held(u32::from(entry & 31)) {
            // Every fourth code or so; so that the others go straight on.
            cold_path();
            if entry & ESCAPE != 0 {
                bits.skip(u32::from(entry & 15));
                let code = bits.take_signed(width.into());
                *context = self.shape.next_table(*context, code);
                return code;
            }
            taken.fetch();
        }
        *bits = taken;
        *context = (entry >> 13) as u8;
        // In a word: one instruction on Cortex-M4, two on M0+.
        i32::from(entry).wrapping_shl(19) >> 24
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::unsigned;
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

    fn describe(classes: u8, groups: u8, tables: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = std::vec![classes, groups];
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
        let mut random = Random::new(9);
        for (most, n) in [(1, 2), (4, 9), (8, 2), (8, 40), (8, 100), (8, 255)] {
            let tables: Vec<Vec<u8>> = (0..3).map(|_| lengths(&mut random, n, most)).collect();
            let bytes = describe(1, 3, &tables);
            let mut memory = std::vec![0; Shape::read(&bytes).unwrap().words()];
            let mut huffman = Huffman::build(&bytes, &mut memory).unwrap();
            for (table, lengths) in tables.iter().enumerate() {
                for window in (0..=u16::MAX).step_by(stride(32_003)) {
                    let data = [(window >> 8) as u8, window as u8, 0xa5];
                    let mut bits = BitReader::new(&data);
                    let mut context = table as u8;
                    let found = huffman.code(&mut bits, 5, &mut context);
                    let (symbol, length) = bit_by_bit(lengths, window);
                    let mut after = BitReader::at(&data, length.into());
                    let expected = if symbol == n - 1 { after.take_signed(5) } else { signed(symbol as u32) };
                    let expected = (expected, after.position(), table);
                    assert_eq!((found, bits.position(), usize::from(context)), expected, "{window:#018b}");
                }
            }
        }
    }

    /// From every table, after every code: what the entries say is what the rule says.
    #[test]
    fn entries_lead_to_the_next_table() {
        let mut random = Random::new(10);
        for (classes, groups) in [(8, 1), (4, 2), (3, 2), (1, 8), (1, 1)] {
            let count = usize::from(classes * groups);
            let tables: Vec<Vec<u8>> = (0..count).map(|_| lengths(&mut random, 60, 8)).collect();
            let bytes = describe(classes, groups, &tables);
            let mut memory = std::vec![0; Shape::read(&bytes).unwrap().words()];
            let mut huffman = Huffman::build(&bytes, &mut memory).unwrap();
            let shape = huffman.shape();
            for table in 0..count as u8 {
                for first in (0..=255u8).step_by(stride(61)) {
                    // Escapes of up to 8 bits and 16 of their own; their codes are 0 to 65535 in two's complement.
                    let data = [first, first.wrapping_mul(77), 3, 200, 9];
                    let mut context = table;
                    let code = huffman.code(&mut BitReader::new(&data), 16, &mut context);
                    assert_eq!(context, shape.next_table(table, code));
                    assert_eq!(context / classes, table / classes, "groups stay");
                }
            }
        }
    }

    #[test]
    fn classes_are_their_definition() {
        for classes in 1..=8u8 {
            for class in 0..classes {
                for symbol in (0..70_000u32).step_by(stride(20_011)) {
                    let code = signed(symbol);
                    let above = LEVEL_ENDS.iter().filter(|&&end| code.unsigned_abs() > end).count() as i32;
                    let (level, k) = (above.min(i32::from(classes) - 1), i32::from(class));
                    let found = next_class(class, code, classes);
                    assert_eq!(i32::from(found), level.max(k - 1), "{classes} {class} {symbol}");
                    assert!(found < classes && unsigned(code) == symbol);
                }
            }
        }
    }

    #[test]
    fn a_lone_symbol_takes_no_bits() {
        let bytes = [2, 1, 0, 3, 2, 0x11];
        let mut memory = [0; 512];
        let mut huffman = Huffman::build(&bytes, &mut memory).unwrap();
        let mut bits = BitReader::new(&[0b0100_0000]);
        let mut context = 0;
        assert_eq!(huffman.code(&mut bits, 4, &mut context), -2);
        assert_eq!((bits.position(), context), (0, 1));
        // The other table: symbol 0, or the escape and four bits.
        assert_eq!(huffman.code(&mut bits, 4, &mut context), 0);
        assert_eq!((bits.position(), context), (1, 0));
        context = 1;
        assert_eq!(huffman.code(&mut bits, 4, &mut context), 0);
        assert_eq!((bits.position(), context), (6, 0));
        context = NO_TABLE;
        assert_eq!(huffman.code(&mut bits, 4, &mut context), 0);
        assert_eq!((bits.position(), context), (6, NO_TABLE));
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_place() {
        let mut memory = [0; 512];
        let mut error = |bytes: &[u8]| Huffman::build(bytes, &mut memory).unwrap_err();
        assert_eq!(error(&[1]), TableError::Truncated { at: 1 });
        assert_eq!(error(&[0, 1]), TableError::Range { at: 0, found: 0, low: 1, high: 8 });
        assert_eq!(error(&[9, 1]), TableError::Range { at: 0, found: 9, low: 1, high: 8 });
        assert_eq!(error(&[3, 3]), TableError::Range { at: 1, found: 3, low: 1, high: 2 });
        assert_eq!(error(&[1, 1]), TableError::Truncated { at: 2 });
        assert_eq!(error(&[1, 1, 0]), TableError::Truncated { at: 3 });
        assert_eq!(error(&[1, 1, 3, 0x21]), TableError::Truncated { at: 4 });
        assert_eq!(error(&[1, 1, 2, 0x91]), TableError::Range { at: 3, found: 9, low: 0, high: 8 });
        assert_eq!(error(&[1, 1, 2, 0x21]), TableError::Incomplete { at: 2, filled: 192, entries: 256 });
        assert_eq!(error(&[1, 1, 3, 0x11, 1]), TableError::Incomplete { at: 2, filled: 384, entries: 256 });
        assert_eq!(error(&[1, 1, 2, 0x11, 7]), TableError::TooLong { used: 4, found: 5 });
        assert_eq!(error(&[3, 1, 2, 0x11]), TableError::Memory { needed: 768 });
    }
}
