//! Step multipliers of the adaptive quantiser (7-7), trained on motions. Written by a command:
//!
//! ```text
//! bunraku train 02_07.amc 05_02.amc 09_01.amc 49_04.amc 49_14.amc --held-out 01_04.amc
//! 02_01.amc 02_02.amc 05_03.amc 14_09.amc 16_46.amc 135_04.amc --fps 30,120 -o encoder/src/codec/adpcm/multipliers.rs
//! ```
//!
//! Displacement of the joints (root mean square, in cm) that remained on the motions held out:
//!
//! | bits | steps that stay | Jayant's multipliers | these |
//! |---|---|---|---|
//! | 2 | 17.4891 | 21.0227 | 16.2874 |
//! | 3 | 9.2627 | 7.1920 | 6.8767 |
//! | 4 | 5.2524 | 4.2040 | 4.5934 |
//! | 5 | 2.9166 | 3.2709 | 2.5618 |
//! | 6 | 1.5510 | 2.5875 | 1.5510 |

/// Bits of the codes that the first table is for; each one after it has a bit more.
pub const FEWEST_BITS: u8 = 2;

/// log₂ β in eighths for the eight classes of a code's magnitude, and the index of the lowest step.
pub const TRAINED: [([i8; 8], u8); 5] = [
    ([-4, -4, -3, -3, 2, 4, 6, 12], 84),
    ([-2, -2, -1, -1, 3, 3, 8, 6], 76),
    ([0, -1, 0, 0, 2, 4, 3, 6], 64),
    ([-2, 0, 1, 2, 6, 6, 8, 16], 65),
    ([0, 0, 0, 0, 0, 0, 0, 0], 32),
];
