//! Decodes prefix codes by the decoder's table and bit by bit, in turns, so that both can be measured in one run.
//!
//! A frame is [`COUNT`] codes: even frames are decoded by the table, odd ones are the same codes bit by bit.
#![no_std]
#![no_main]

mod ends;

use core::hint::black_box;
use cortex_m_rt::entry;
use decoder_core::arithmetic::signed;
use decoder_core::bits::BitReader;
use decoder_core::entropy::SymbolSource;
use decoder_core::entropy::huffman::{Huffman, INDEX_BITS};
use ends::{failed, finished};

/// Codes of a frame.
const COUNT: usize = 256;

/// Frames of each kind.
const TURNS: u32 = 8;

/// Bits of a code that is escaped.
const WIDTH: u8 = 6;

/// Lengths of the prefixes of symbols 0 to 31 and of the escape: 3.8 bits a code, where a walk in codes of 6 bits has 4.0.
const LENGTHS: [u8; 33] =
    [2, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 6, 6, 7, 7, 7, 7, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8];

/// The same as a header describes them: one class, one group.
static TABLES: [u8; 20] = [
    1, 1, 33, 0x32, 0x43, 0x44, 0x54, 0x55, 0x65, 0x76, 0x77, 0x87, 0x88, 0x88, 0x88, 0x88, 0x88, 0x88, 0x88,
    8,
];

struct State {
    huffman: Huffman<'static>,
    serial: Serial,
    bytes: [u8; COUNT],
    codes: [i32; COUNT],
    turns: u32,
}

#[entry]
fn main() -> ! {
    static mut WORDS: [u16; 256] = [0; 256];
    let Some(mut state) = open(black_box(&TABLES), WORDS) else { failed() };
    while let Some(codes) = decode_frame(&mut state) {
        black_box(codes);
    }
    finished()
}

/// Builds the tables of both.
#[inline(never)]
#[unsafe(no_mangle)]
fn open(tables: &[u8], words: &'static mut [u16]) -> Option<State> {
    let huffman = Huffman::build(tables, words).ok()?;
    Some(State { huffman, serial: Serial::new(), bytes: [0; COUNT], codes: [0; COUNT], turns: 0 })
}

/// What is measured: the codes of a frame, by the table in even turns, and bit by bit in odd ones.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame(state: &mut State) -> Option<&[i32]> {
    let State { huffman, serial, bytes, codes, turns } = state;
    if *turns >= 2 * TURNS {
        return None;
    }
    // Any bits are prefix codes, with just the frequencies that the lengths are for.
    let mut random = 0x1234_5678u32.wrapping_add(*turns >> 1);
    bytes.iter_mut().for_each(|byte| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *byte = (random >> 24) as u8;
    });
    // How many there are is no constant for a decoder.
    let (bytes, codes_now) = (black_box(bytes.as_slice()), black_box(codes.as_mut_slice()));
    if *turns & 1 == 0 {
        by_table(*huffman, bytes, codes_now);
    } else {
        bit_by_bit(serial, bytes, codes_now);
    }
    *turns += 1;
    Some(codes)
}

#[inline(never)]
fn by_table(mut huffman: Huffman<'_>, bytes: &[u8], codes: &mut [i32]) {
    let mut bits = BitReader::new(bytes);
    let mut context = 0;
    for code in codes {
        *code = huffman.code(&mut bits, WIDTH, &mut context);
    }
}

/// What a decoder bit by bit needs: how many prefixes each length has, and their symbols in order.
struct Serial {
    counts: [u8; INDEX_BITS as usize + 1],
    symbols: [u8; LENGTHS.len()],
}

impl Serial {
    fn new() -> Self {
        let (mut counts, mut symbols) = ([0; INDEX_BITS as usize + 1], [0; LENGTHS.len()]);
        let mut next = symbols.iter_mut();
        for (length, count) in (0u8..).zip(&mut counts) {
            for (symbol, _) in (0u8..).zip(LENGTHS).filter(|&(_, other)| other == length) {
                *count += 1;
                if let Some(slot) = next.next() {
                    *slot = symbol;
                }
            }
        }
        Self { counts, symbols }
    }
}

/// Canonical prefixes bit by bit: at each length, whether the prefix is one of so many that begin with `first`.
#[inline(never)]
fn bit_by_bit(serial: &Serial, bytes: &[u8], codes: &mut [i32]) {
    let mut bits = BitReader::new(bytes);
    for slot in codes {
        let (mut prefix, mut first, mut index) = (0u32, 0u32, 0u32);
        for &count in &serial.counts[1..] {
            prefix |= bits.take(1);
            let count = u32::from(count);
            let above = prefix.wrapping_sub(first);
            if above < count {
                index += above;
                break;
            }
            index += count;
            first = (first + count) << 1;
            prefix <<= 1;
        }
        let symbol = serial.symbols.get(index as usize).copied().unwrap_or(0);
        *slot = if usize::from(symbol) == LENGTHS.len() - 1 {
            bits.take_signed(WIDTH.into())
        } else {
            signed(symbol.into())
        };
    }
}
