//! Static Huffman tables: the best code lengths under a limit, and how a header describes them.

use decoder_core::arithmetic::{signed, unsigned};
use decoder_core::bits::BitWriter;
use decoder_core::entropy::huffman::{INDEX_BITS, Shape};

/// Numbers of classes to choose from.
pub(crate) const CLASS_COUNTS: [u8; 4] = [1, 3, 5, 8];

/// A code book of one table.
#[derive(Clone, Debug)]
pub(crate) struct Book {
    /// Length and code of each symbol; length 0 is none.
    codes: Vec<(u8, u16)>,
    /// Number of the escape among them.
    escape: usize,
    /// The only symbol, where there is but one.
    only: Option<u32>,
}

/// Books for every class, and their description.
#[derive(Clone, Debug)]
pub(crate) struct Books {
    shape: Shape,
    books: Vec<Book>,
    pub bytes: Vec<u8>,
}

impl Books {
    /// The best books with so many classes for sequences of codes, each with its width and class.
    pub fn fit(codes: &[(i32, u8, u8)], classes: u8) -> Self {
        let mut counts = vec![vec![0u64; 255]; usize::from(classes)];
        // Widths of what escapes.
        let mut far = vec![(0u64, 0u64); usize::from(classes)];
        for &(code, width, class) in codes {
            let class = usize::from(class);
            match counts[class].get_mut(unsigned(code) as usize) {
                Some(count) => *count += 1,
                None => {
                    far[class].0 += 1;
                    far[class].1 += u64::from(width);
                }
            }
        }
        let width = codes.iter().map(|&(_, width, _)| width).max().unwrap_or(1);
        let books: Vec<Book> =
            counts.iter().zip(far).map(|(counts, (far, _))| Book::fit(counts, far, width)).collect();
        let mut bytes = vec![classes, 1];
        books.iter().for_each(|book| book.describe(&mut bytes));
        Self { shape: Shape { classes, groups: 1 }, books, bytes }
    }

    /// Writes a code of a channel whose next table is `table`.
    pub fn write(&self, code: i32, width: u8, table: &mut u8, out: &mut BitWriter<Vec<u8>>) {
        self.books[usize::from(*table)].write(code, width, out);
        *table = self.shape.next_table(*table, code);
    }
}

impl Book {
    /// `counts` of symbols 0 to 254, and of all above. A symbol that costs less as an escape of `width` bits than
    /// its place in the description is left to the escape.
    fn fit(counts: &[u64], far: u64, width: u8) -> Self {
        let total: u64 = counts.iter().sum::<u64>() + far;
        let used: Vec<usize> = (0..counts.len()).filter(|&symbol| counts[symbol] > 0).collect();
        if far == 0 && used.len() <= 1 {
            let only = used.first().map_or(0, |&symbol| symbol as u32);
            return Self { codes: Vec::new(), escape: 0, only: Some(only) };
        }
        // The best number of leading symbols that have codes; the rest escapes.
        let most = used.last().map_or(0, |&last| last + 1).min(254);
        let mut best: Option<(u64, Vec<u8>)> = None;
        for end in 1..=most.max(1) {
            let escaped = total - counts[..end].iter().sum::<u64>();
            let mut weights = counts[..end].to_vec();
            // A table of escapes alone would have a code of no bits; the description has no such thing.
            weights.push(escaped);
            if weights.iter().filter(|&&weight| weight > 0).count() < 2 {
                let spare = weights.iter().position(|&weight| weight == 0).unwrap_or(0);
                weights[spare] = 1;
            }
            let lengths = lengths(&weights, INDEX_BITS);
            let bits: u64 =
                weights.iter().zip(&lengths).map(|(&weight, &length)| weight * u64::from(length)).sum();
            let cost = bits + escaped * u64::from(width) + 4 * (end as u64 + 1);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, lengths));
            }
        }
        let lengths = best.map(|(_, lengths)| lengths).unwrap_or_default();
        let escape = lengths.len() - 1;
        Self { codes: canonical(&lengths), escape, only: None }
    }

    fn describe(&self, bytes: &mut Vec<u8>) {
        if let Some(only) = self.only {
            bytes.extend([0, only as u8]);
            return;
        }
        bytes.push(self.codes.len() as u8);
        bytes.extend(self.codes.chunks(2).map(|pair| pair[0].0 | pair.get(1).map_or(0, |code| code.0 << 4)));
    }

    fn write(&self, code: i32, width: u8, out: &mut BitWriter<Vec<u8>>) {
        if self.only.is_some_and(|only| signed(only) == code) {
            return;
        }
        match self.codes[..self.escape].get(unsigned(code) as usize) {
            Some(&(length, prefix)) if length > 0 => out.put(prefix.into(), length.into()),
            _ => {
                let (length, prefix) = self.codes[self.escape];
                out.put(prefix.into(), length.into());
                out.put_signed(code, width.into());
            }
        }
    }
}

/// Canonical codes of these lengths: shorter ones first, then in the order of symbols.
fn canonical(lengths: &[u8]) -> Vec<(u8, u16)> {
    let mut codes = vec![(0, 0); lengths.len()];
    let (mut next, mut before) = (0u32, 0u8);
    for length in 1..=16 {
        next <<= length - before;
        before = length;
        for symbol in (0..lengths.len()).filter(|&symbol| lengths[symbol] == length) {
            codes[symbol] = (length, next as u16);
            next += 1;
        }
    }
    codes
}

/// Code lengths of at most `limit` bits with the least sum of weight × length, by package-merge (Larmore and
/// Hirschberg, 1990). Weights of 0 get no code; at least two and at most `2^limit` are above.
fn lengths(weights: &[u64], limit: u8) -> Vec<u8> {
    let mut leaves: Vec<(u64, Vec<usize>)> =
        (0..weights.len()).filter(|&i| weights[i] > 0).map(|i| (weights[i], vec![i])).collect();
    leaves.sort_by_key(|leaf| leaf.0);
    let mut level = leaves.clone();
    for _ in 1..limit {
        let mut packages: Vec<(u64, Vec<usize>)> = level
            .chunks_exact(2)
            .map(|pair| (pair[0].0 + pair[1].0, [pair[0].1.as_slice(), &pair[1].1].concat()))
            .collect();
        packages.extend(leaves.iter().cloned());
        packages.sort_by_key(|package| package.0);
        level = packages;
    }
    let mut lengths = vec![0; weights.len()];
    for (_, symbols) in level.iter().take(2 * leaves.len() - 2) {
        symbols.iter().for_each(|&symbol| lengths[symbol] += 1);
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits of the best code without a limit, by the textbook.
    fn optimum(weights: &[u64]) -> u64 {
        let mut weights: Vec<u64> = weights.iter().copied().filter(|&weight| weight > 0).collect();
        let mut total = 0;
        while weights.len() > 1 {
            weights.sort_unstable_by(|a, b| b.cmp(a));
            let sum = weights.pop().unwrap() + weights.pop().unwrap();
            total += sum;
            weights.push(sum);
        }
        total
    }

    fn cost(weights: &[u64], lengths: &[u8]) -> u64 {
        weights.iter().zip(lengths).map(|(&weight, &length)| weight * u64::from(length)).sum()
    }

    #[test]
    fn lengths_are_the_best_ones_and_fill_the_code() {
        let mut rng = fastrand::Rng::with_seed(1);
        for n in 2..60 {
            let weights: Vec<u64> = (0..n).map(|_| rng.u64(..16)).collect();
            if weights.iter().filter(|&&weight| weight > 0).count() < 2 {
                continue;
            }
            let free = lengths(&weights, 15);
            assert_eq!(cost(&weights, &free), optimum(&weights), "{weights:?}");
            let limited = lengths(&weights, 6);
            let kraft: u32 = limited.iter().filter(|&&length| length > 0).map(|&length| 64 >> length).sum();
            assert_eq!(kraft, 64);
        }
    }

    #[test]
    fn a_limit_costs_what_it_must() {
        // Fibonacci weights want lengths up to 7; three bits hold 8 symbols of equal length.
        let weights = [1, 1, 2, 3, 5, 8, 13, 21];
        assert_eq!(lengths(&weights, 3), [3; 8]);
        assert_eq!(lengths(&weights, 7), [7, 7, 6, 5, 4, 3, 2, 1]);
        // By hand: two codes of 2 bits, two of 3 and four of 4.
        assert_eq!(cost(&weights, &lengths(&weights, 4)), 2 * (21 + 13) + 3 * (8 + 5) + 4 * (3 + 2 + 1 + 1));
    }
}
