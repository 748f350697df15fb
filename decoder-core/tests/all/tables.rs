//! Every window of 16 bits of every prefix table of the golden vectors, against a decoder that reads bit by bit from the
//! tables' description (docs/FORMAT.md); and every transition of their adaptive quantisers.

use crate::common::{LIMITS, vectors};
use decoder_core::bits::BitReader;
use decoder_core::codec::LinkedCodec;
use decoder_core::codec::adpcm::Steps;
use decoder_core::codec::scalar::LinkedScalar;
use decoder_core::entropy::{Huffman, SymbolSource};
use decoder_core::mclip::{EntropyId, Header};
use decoder_core::quantise::Quantise;
use decoder_core::quantise::step;

/// Bits of a code that follows an escape here; what a channel's own width is makes no difference to a table.
const WIDTH: usize = 7;

/// A table's code lengths, the last one that of the escape; or its only symbol.
enum Table {
    Lengths(Vec<u8>),
    Only(u8),
}

/// The tables of a description: classes, groups, and of each table n and its lengths, a nibble each.
fn tables(description: &[u8]) -> Vec<Table> {
    let (&[classes, groups], mut rest) = description.split_first_chunk::<2>().unwrap();
    let mut tables = Vec::new();
    for _ in 0..classes * groups {
        let n = usize::from(rest[0]);
        if n == 0 {
            tables.push(Table::Only(rest[1]));
            rest = &rest[2..];
            continue;
        }
        let nibbles = rest[1..][..n.div_ceil(2)].iter().flat_map(|byte| [byte & 15, byte >> 4]);
        tables.push(Table::Lengths(nibbles.take(n).collect()));
        rest = &rest[1 + n.div_ceil(2)..];
    }
    assert!(rest.is_empty());
    tables
}

/// The code at the front of `window`, and the bits that it takes.
fn bit_by_bit(table: &Table, window: u32) -> (i32, usize) {
    let signed =
        |symbol: usize| if symbol.is_multiple_of(2) { symbol as i32 / 2 } else { -(symbol as i32 + 1) / 2 };
    let lengths = match table {
        Table::Only(symbol) => return (signed((*symbol).into()), 0),
        Table::Lengths(lengths) => lengths,
    };
    // Canonical codes: counted up in the order of their lengths, then of their symbols.
    let (mut code, mut first) = (0, 0);
    for length in 1..=15 {
        code = code << 1 | (window >> (32 - length) & 1) as usize;
        first <<= 1;
        let of_length: Vec<usize> =
            (0..lengths.len()).filter(|&s| usize::from(lengths[s]) == length).collect();
        if code < first + of_length.len() {
            let symbol = of_length[code - first];
            if symbol + 1 < lengths.len() {
                return (signed(symbol), length);
            }
            let own = window << length >> (32 - WIDTH);
            let negative = own >> (WIDTH - 1) == 1;
            return (own as i32 - if negative { 1 << WIDTH } else { 0 }, length + WIDTH);
        }
        first += of_length.len();
    }
    panic!("no code for {window:#b}");
}

#[test]
fn every_window_of_sixteen_bits_of_every_table_of_the_vectors() {
    let mut count = 0;
    for vector in vectors("SHA256SUMS.mclip") {
        let header = Header::parse(&vector.bytes, LIMITS).unwrap();
        if header.entropy() != EntropyId::Huffman {
            continue;
        }
        let mut memory = vec![0; header.needs().halves];
        let mut huffman = Huffman::build(header.fields().tables, &mut memory).unwrap();
        for (number, table) in tables(header.fields().tables).iter().enumerate() {
            for window in (0..1u32 << 16).step_by(if cfg!(miri) { 8009 } else { 1 }) {
                // Behind it comes what an escape at its end goes on with.
                let window = window << 16 | 0xa5c3;
                let data = window.to_be_bytes();
                let mut bits = BitReader::new(&data);
                let found = huffman.code(&mut bits, WIDTH as u8, &mut { number as u8 });
                let expected = bit_by_bit(table, window);
                assert_eq!(
                    (found, bits.position()),
                    expected,
                    "{} table {number} {window:#034b}",
                    vector.name
                );
            }
            count += 1;
        }
    }
    assert!(count > 3, "{count} tables");
}

/// All steps and codes of all widths that the adaptive quantisers of the vectors can meet.
#[test]
fn every_transition_of_the_quantisers_of_the_vectors() {
    let mut count = 0;
    for vector in vectors("SHA256SUMS.mclip") {
        let header = Header::parse(&vector.bytes, LIMITS).unwrap();
        let &LinkedCodec::Scalar(LinkedScalar::Adpcm(adpcm)) = header.codec() else { continue };
        let Steps::Adaptive(quantiser) = adpcm.steps else { continue };
        for bits in 1..=if cfg!(miri) { 3 } else { 10u8 } {
            let codes = 1i64 << bits;
            for index in (quantiser.low..=quantiser.high).step_by(if cfg!(miri) { 67 } else { 1 }) {
                for code in -codes / 2..codes / 2 {
                    let mut state = quantiser.step(index);
                    let difference = quantiser.difference(code as i32, &mut state, bits);
                    assert_eq!(difference, (code * i64::from(step::size(index))) as i32);
                    // A sixteenth of the codes has a multiplier in common: from 0 up, then from the lowest up.
                    let class = (code * 16).div_euclid(codes).rem_euclid(16) as usize;
                    let by = i32::from(quantiser.multipliers[class]);
                    let next = (i32::from(index) + by).clamp(quantiser.low.into(), quantiser.high.into());
                    assert_eq!(
                        state.word() as u8,
                        quantiser.step(next as u8).word() as u8,
                        "{} {bits} bits: {index} {code}",
                        vector.name
                    );
                    count += 1;
                }
            }
        }
    }
    assert!(count > 100, "{count}");
}
