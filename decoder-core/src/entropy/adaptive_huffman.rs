//! Adaptive Huffman codes, by the algorithm of Faller, Gallager and Knuth.
//!
//! The tree begins with codes of equal length (waveform coding, 7.4) and counts every symbol. It keeps Gallager's
//! sibling property: in the order of the nodes weights do not ascend, and siblings are next to each other. So the
//! code is at any time a Huffman code of the counts so far, and an update moves a node at most once a level.
//!
//! Bounds: `2^bits` symbols take [`AdaptiveHuffman::words`] 16-bit words. Counting stops when the root weighs
//! [`MAX_WEIGHT`], so no code is longer than 21 bits. An update looks at each node at most once for each level.

use super::stage::{FrameLoops, Stage};
use super::symbols::SymbolSource;
use crate::arithmetic::signed;
use crate::bits::BitReader;
use crate::error::{Error, Field, check};

/// Weight of the root at which counting stops.
pub const MAX_WEIGHT: u16 = 1 << 15;

/// No code is longer: a code of n bits takes a weight of the (n + 2)th Fibonacci number.
const MAX_LENGTH: u32 = 21;

/// Most bits of the alphabet.
pub const MAX_BITS: u8 = 8;

/// In `children`: the node is a leaf, and the rest is its symbol.
const LEAF: u16 = 1 << 15;

/// A tree over `2^bits` symbols, of which the last is the escape, followed by the symbol in the channel's width.
///
/// Node 0 is the root; nodes 2i + 1 and 2i + 2 are siblings.
#[derive(Debug)]
pub struct AdaptiveHuffman<'t> {
    /// Of each node, the times that a symbol below it came, and one for each symbol.
    weights: &'t mut [u16],
    /// Of each node, its first child, or its symbol.
    children: &'t mut [u16],
    /// Of each pair of siblings, their parent.
    parents: &'t mut [u16],
    /// Of each symbol, its node.
    leaves: &'t mut [u16],
}

impl<'t> AdaptiveHuffman<'t> {
    /// Words of memory that a tree takes.
    pub const fn words(bits: u8) -> usize {
        // 2K − 1 weights and children, K − 1 parents, K leaves.
        6usize.wrapping_shl(bits as u32).wrapping_sub(3)
    }

    /// A tree in `memory` before its first symbol; `bits` is 1 to [`MAX_BITS`]. `None` where the memory is too small.
    pub fn new(bits: u8, memory: &'t mut [u16]) -> Option<Self> {
        let mut tree = Self::resume(bits, memory)?;
        tree.reset();
        Some(tree)
    }

    /// The tree that was left in `memory`.
    pub fn resume(bits: u8, memory: &'t mut [u16]) -> Option<Self> {
        if bits == 0 || bits > MAX_BITS {
            return None;
        }
        let symbols = 1usize.wrapping_shl(u32::from(bits));
        let nodes = symbols.wrapping_mul(2).wrapping_sub(1);
        let (weights, rest) = memory.split_at_mut_checked(nodes)?;
        let (children, rest) = rest.split_at_mut_checked(nodes)?;
        let (parents, rest) = rest.split_at_mut_checked(symbols.wrapping_sub(1))?;
        let leaves = rest.get_mut(..symbols)?;
        Some(Self { weights, children, parents, leaves })
    }

    /// Back to codes of equal length, each symbol counted once.
    pub fn reset(&mut self) {
        let symbols = self.leaves.len() as u16;
        let first_leaf = symbols.wrapping_sub(1);
        // Level by level, as in a heap.
        let (mut level_end, mut weight) = (1u16, symbols);
        let mut node = 0u16;
        for (slot, child) in self.weights.iter_mut().zip(self.children.iter_mut()) {
            if node == level_end {
                level_end = level_end.wrapping_mul(2).wrapping_add(1);
                weight >>= 1;
            }
            *slot = weight;
            *child = if node < first_leaf {
                node.wrapping_mul(2).wrapping_add(1)
            } else {
                LEAF | node.wrapping_sub(first_leaf)
            };
            node = node.wrapping_add(1);
        }
        self.parents.iter_mut().enumerate().for_each(|(node, parent)| *parent = node as u16);
        let leaves = self.leaves.iter_mut().enumerate();
        leaves.for_each(|(symbol, leaf)| *leaf = first_leaf.wrapping_add(symbol as u16));
    }

    /// The escape: the last symbol.
    pub const fn escape(&self) -> u32 {
        (self.leaves.len() as u32).wrapping_sub(1)
    }

    /// The code of a symbol and its length in bits. Only an encoder needs it.
    pub fn code(&self, symbol: u32) -> (u32, u32) {
        let (mut code, mut length) = (0u32, 0u32);
        let mut node = self.leaf(symbol);
        while node > 0 && length < MAX_LENGTH {
            // The second of two siblings has an even number.
            code |= u32::from(node & 1 == 0).wrapping_shl(length);
            length = length.wrapping_add(1);
            node = self.parent(node);
        }
        (code, length)
    }

    /// Counts a symbol.
    pub fn count(&mut self, symbol: u32) {
        if self.weight(0) >= MAX_WEIGHT {
            return;
        }
        let mut node = self.leaf(symbol);
        // A parent weighs more than its child, since every weight is 1 at least; so this comes to the root.
        while node > 0 {
            let weight = self.weight(node);
            let mut leader = node;
            while leader > 1 && self.weight(leader.wrapping_sub(1)) == weight {
                leader = leader.wrapping_sub(1);
            }
            self.swap(node, leader);
            set(self.weights, leader, weight.wrapping_add(1));
            let parent = self.parent(leader);
            if parent >= leader {
                // Cannot be, whatever was counted; ends the loop if memory was tampered with.
                return;
            }
            node = parent;
        }
        let root = self.weight(0);
        set(self.weights, 0, root.wrapping_add(1));
    }

    /// Exchanges what is below two nodes of equal weight.
    fn swap(&mut self, a: u16, b: u16) {
        if a == b {
            return;
        }
        let (below_a, below_b) = (get(self.children, a), get(self.children, b));
        self.attach(a, below_b);
        self.attach(b, below_a);
    }

    fn attach(&mut self, node: u16, child: u16) {
        set(self.children, node, child);
        if child & LEAF != 0 {
            set(self.leaves, child & !LEAF, node);
        } else {
            set(self.parents, child >> 1, node);
        }
    }

    fn weight(&self, node: u16) -> u16 {
        get(self.weights, node)
    }

    fn parent(&self, node: u16) -> u16 {
        get(self.parents, node.wrapping_sub(1) >> 1)
    }

    fn leaf(&self, symbol: u32) -> u16 {
        self.leaves.get(symbol as usize).copied().unwrap_or(0)
    }
}

fn get(words: &[u16], index: u16) -> u16 {
    words.get(usize::from(index)).copied().unwrap_or(0)
}

fn set(words: &mut [u16], index: u16, value: u16) {
    if let Some(word) = words.get_mut(usize::from(index)) {
        *word = value;
    }
}

impl<'s> Stage<'s> for AdaptiveHuffman<'s> {
    fn check(tables: &[u8], at: usize) -> Result<u8, Error> {
        let &[bits] = tables else { return Err(Error::Encoding { field: Field::CodeTables, at }) };
        check(Field::CodeTables, at, bits.into(), 1, MAX_BITS.into())?;
        Ok(1)
    }

    fn halves(tables: &[u8]) -> usize {
        if let &[bits] = tables { Self::words(bits) } else { 0 }
    }

    fn open(tables: &[u8], at: usize, halves: &'s mut [u16]) -> Result<Self, Error> {
        let bits = tables.first().copied().unwrap_or(0);
        Self::new(bits, halves).ok_or(Error::Encoding { field: Field::CodeTables, at })
    }

    fn context(&self, _: u8, _: u8) -> u8 {
        0
    }

    #[inline(always)]
    fn restart<'c>(&mut self, _: impl Iterator<Item = &'c mut u8>) {
        self.reset();
    }

    #[inline(always)]
    fn feed<L: FrameLoops>(&mut self, loops: L) -> Option<usize> {
        loops.by_symbols(self)
    }
}

impl SymbolSource for &mut AdaptiveHuffman<'_> {
    #[inline(always)]
    fn code(&mut self, bits: &mut BitReader<'_>, width: u8, _: &mut u8) -> i32 {
        if width == 0 { 0 } else { self.decode(bits, width) }
    }
}

impl AdaptiveHuffman<'_> {
    /// Decodes a code and counts it. One function for all loops: it is long, and its time is that of the tree.
    #[inline(never)]
    fn decode(&mut self, bits: &mut BitReader<'_>, width: u8) -> i32 {
        let mut child = get(self.children, 0);
        for _ in 0..MAX_LENGTH {
            if child & LEAF != 0 {
                break;
            }
            child = get(self.children, child.wrapping_add(bits.take_bit() as u16));
        }
        let symbol = u32::from(child & !LEAF);
        self.count(symbol);
        if symbol == self.escape() { bits.take_signed(width.into()) } else { signed(symbol) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, times};
    use std::vec;
    use std::vec::Vec;

    fn memory(bits: u8) -> Vec<u16> {
        vec![0; AdaptiveHuffman::words(bits)]
    }

    fn check(tree: &AdaptiveHuffman<'_>) {
        assert!(tree.weights.windows(2).all(|pair| pair[0] >= pair[1]), "sibling property");
        for (node, &child) in (0u16..).zip(tree.children.iter()) {
            if child & LEAF != 0 {
                assert_eq!(tree.leaf(u32::from(child & !LEAF)), node);
            } else {
                assert_eq!((tree.parent(child), tree.parent(child + 1)), (node, node));
                assert_eq!(tree.weight(node), tree.weight(child) + tree.weight(child + 1));
            }
        }
    }

    /// Bits of the best prefix code for these weights, by the textbook.
    fn optimum(weights: &[u64]) -> u64 {
        let mut weights = weights.to_vec();
        let mut total = 0;
        while weights.len() > 1 {
            weights.sort_unstable_by(|a, b| b.cmp(a));
            let sum = weights.pop().unwrap() + weights.pop().unwrap();
            total += sum;
            weights.push(sum);
        }
        total
    }

    #[test]
    fn it_is_a_huffman_code_of_the_counts_at_any_time() {
        let mut random = Random::new(10);
        for bits in 1..=times(MAX_BITS.into(), 3) as u8 {
            let mut memory = memory(bits);
            let mut tree = AdaptiveHuffman::new(bits, &mut memory).unwrap();
            let mut counts = vec![1u64; 1 << bits];
            for step in 0..times(3000, 310) {
                if step % 300 < 3 {
                    check(&tree);
                    let total: u64 =
                        counts.iter().zip(0..).map(|(&n, symbol)| n * u64::from(tree.code(symbol).1)).sum();
                    assert_eq!(total, optimum(&counts), "{bits} bits, step {step}");
                }
                let skewed = random.below(1 << bits) & random.below(1 << bits) & random.below(1 << bits);
                tree.count(skewed as u32);
                counts[skewed] += 1;
            }
        }
    }

    #[test]
    fn codes_decode_to_their_symbols() {
        let mut random = Random::new(11);
        let (mut ours, mut theirs) = (memory(5), memory(5));
        let mut encoder = AdaptiveHuffman::new(5, &mut ours).unwrap();
        let mut decoder = AdaptiveHuffman::new(5, &mut theirs).unwrap();
        let mut written = Vec::new();
        let mut symbols = Vec::new();
        for _ in 0..times(40_000, 400) {
            let symbol = if random.below(50) == 0 {
                31 + random.below(200)
            } else {
                random.below(6) * random.below(6)
            };
            symbols.push(symbol as u32);
            let coded = (symbol as u32).min(encoder.escape());
            let (code, length) = encoder.code(coded);
            assert!(length <= MAX_LENGTH);
            written.extend((0..length).rev().map(|bit| code >> bit & 1 == 1));
            if coded == encoder.escape() {
                let code = signed(symbol as u32);
                written.extend((0..9).rev().map(|bit| code >> bit & 1 == 1));
            }
            encoder.count(coded);
        }
        let bytes: Vec<u8> = written
            .chunks(8)
            .map(|byte| (0..8).fold(0, |b, i| b << 1 | u8::from(*byte.get(i).unwrap_or(&false))))
            .collect();
        let mut bits = BitReader::new(&bytes);
        for &symbol in &symbols {
            assert_eq!((&mut decoder).code(&mut bits, 9, &mut 0), signed(symbol));
        }
        assert_eq!(bits.position(), written.len());
        assert!(cfg!(miri) || decoder.weight(0) == MAX_WEIGHT, "counting stopped");
        check(&decoder);
    }

    #[test]
    fn fibonacci_weights_make_the_longest_codes() {
        // Counts like Fibonacci numbers make the deepest tree.
        let mut memory = memory(4);
        let mut tree = AdaptiveHuffman::new(4, &mut memory).unwrap();
        let (mut a, mut b) = (1u32, 1u32);
        for symbol in 0..16 {
            (1..a).for_each(|_| tree.count(symbol));
            (a, b) = (b, a + b);
        }
        let mut lengths = Vec::from_iter((0..16).map(|symbol| tree.code(symbol).1));
        lengths.sort_unstable();
        assert_eq!(lengths[13..], [14, 15, 15]);
        // So a code of n bits takes a root of the (n + 2)th Fibonacci number.
        let root = (0..MAX_LENGTH + 2).fold((1u32, 1u32), |(a, b), _| (b, a + b)).0;
        assert!(root > u32::from(MAX_WEIGHT), "a code of more than {MAX_LENGTH} bits takes {root}");
        check(&tree);
    }

    #[test]
    fn memory_that_is_too_small_is_none() {
        assert!(AdaptiveHuffman::new(4, &mut [0; 92]).is_none());
        assert!(AdaptiveHuffman::new(4, &mut [0; 93]).is_some());
        assert!(AdaptiveHuffman::new(0, &mut [0; 93]).is_none());
        assert!(AdaptiveHuffman::new(9, &mut [0; 9000]).is_none());
    }

    /// Any memory, such as that of another clip, ends in a symbol.
    #[test]
    #[cfg_attr(miri, ignore = "equal weights of nodes that are not there are looked at one by one: minutes")]
    fn a_tree_of_noise_does_not_hang_in_counting() {
        let mut random = Random::new(12);
        for _ in 0..300 {
            let mut memory: Vec<u16> = (0..AdaptiveHuffman::words(3)).map(|_| random.next() as u16).collect();
            let mut tree = AdaptiveHuffman::resume(3, &mut memory).unwrap();
            (0..8).for_each(|symbol| tree.count(symbol));
        }
    }
}
