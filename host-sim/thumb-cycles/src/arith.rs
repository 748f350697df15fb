//! Integer arithmetic as the Arm manual's pseudocode defines it (DDI 0403, A2.2 and A7.4).

use crate::insn::Shift;

/// `x + y + carry`: sum, carry out, signed overflow.
#[inline]
pub fn add_with_carry(x: u32, y: u32, carry: bool) -> (u32, bool, bool) {
    let (sum, first) = x.overflowing_add(y);
    let (sum, second) = sum.overflowing_add(u32::from(carry));
    (sum, first | second, ((x ^ sum) & (y ^ sum)) >> 31 != 0)
}

/// A shift by 0 to 255: result and carry out; a shift by 0 leaves the carry.
#[inline]
pub fn shift(value: u32, kind: Shift, amount: u32, carry: bool) -> (u32, bool) {
    if kind == Shift::Rrx {
        return (value >> 1 | u32::from(carry) << 31, value & 1 != 0);
    }
    if amount == 0 {
        return (value, carry);
    }
    match kind {
        Shift::Lsl => match amount {
            1..=31 => (value << amount, value >> (32 - amount) & 1 != 0),
            32 => (0, value & 1 != 0),
            _ => (0, false),
        },
        Shift::Lsr => match amount {
            1..=31 => (value >> amount, value >> (amount - 1) & 1 != 0),
            32 => (0, value >> 31 != 0),
            _ => (0, false),
        },
        Shift::Asr => {
            let sign = ((value as i32) >> 31) as u32;
            match amount {
                1..=31 => (((value as i32) >> amount) as u32, value >> (amount - 1) & 1 != 0),
                _ => (sign, sign != 0),
            }
        }
        Shift::Ror | Shift::Rrx => {
            let result = value.rotate_right(amount & 31);
            (result, result >> 31 != 0)
        }
    }
}

/// Saturates to `bits` bits, signed: result, and whether it changed.
pub fn saturate_signed(value: i64, bits: u32) -> (u32, bool) {
    let limit = 1i64 << (bits - 1);
    let result = value.clamp(-limit, limit - 1);
    (result as u32, result != value)
}

/// Saturates to `bits` bits, unsigned: result, and whether it changed.
pub fn saturate_unsigned(value: i64, bits: u32) -> (u32, bool) {
    let result = value.clamp(0, (1i64 << bits) - 1);
    (result as u32, result != value)
}

/// Half `top` of a word, with its sign.
pub fn half(word: u32, top: bool) -> i32 {
    i32::from(if top { (word >> 16) as i16 } else { word as i16 })
}

/// The parallel additions and subtractions (A7.7.158 and others): the result and, where it sets them, the GE bits.
///
/// `which` is operation * 8 + kind. Operations: add 8, add 16, add-subtract exchanged, subtract 8, subtract 16,
/// subtract-add exchanged. Kinds: 0 signed, 1 saturating, 2 halving; 4 to 6 the same unsigned.
pub fn parallel(which: u32, n: u32, m: u32) -> (u32, Option<u8>) {
    let (operation, kind) = (which >> 3, which & 7);
    let unsigned = kind & 4 != 0;
    let bits = if operation % 3 == 0 { 8 } else { 16 };
    let lane = |word: u32, number: u32| {
        let part = word >> (number * bits);
        match (bits, unsigned) {
            (8, false) => i32::from(part as i8),
            (8, true) => i32::from(part as u8),
            (_, false) => i32::from(part as i16),
            (_, true) => i32::from(part as u16),
        }
    };
    let lanes = 32 / bits;
    let (mut result, mut ge) = (0u32, 0u8);
    for number in 0..lanes {
        let exchanged = operation == 2 || operation == 5;
        let other = lane(m, if exchanged { 1 - number } else { number });
        let subtract = match operation {
            0 | 1 => false,
            3 | 4 => true,
            2 => number == 0,
            _ => number == 1,
        };
        let value = if subtract { lane(n, number) - other } else { lane(n, number) + other };
        let kept = match kind & 3 {
            0 => value as u32,
            1 if unsigned => saturate_unsigned(i64::from(value), bits).0,
            1 => saturate_signed(i64::from(value), bits).0,
            _ => (value >> 1) as u32,
        };
        let mask = if bits == 8 { 0xff } else { 0xffff };
        result |= (kept & mask) << (number * bits);
        let holds = if unsigned && !subtract { value > mask as i32 } else { value >= 0 };
        if holds {
            ge |= if bits == 8 { 1 << number } else { 3 << (number * 2) };
        }
    }
    (result, (kind & 3 == 0).then_some(ge))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carries_and_overflows() {
        assert_eq!(add_with_carry(u32::MAX, 0, true), (0, true, false));
        assert_eq!(add_with_carry(0x7fff_ffff, 1, false), (0x8000_0000, false, true));
        // 0 - 0x8000_0000
        assert_eq!(add_with_carry(0, !0x8000_0000, true), (0x8000_0000, false, true));
    }

    #[test]
    fn shifts_by_more_than_a_word() {
        assert_eq!(shift(0x8000_0001, Shift::Lsl, 32, false), (0, true));
        assert_eq!(shift(0x8000_0001, Shift::Lsr, 33, true), (0, false));
        assert_eq!(shift(0x8000_0001, Shift::Asr, 200, false), (u32::MAX, true));
        assert_eq!(shift(0x8000_0001, Shift::Ror, 32, false), (0x8000_0001, true));
        assert_eq!(shift(1, Shift::Rrx, 1, false), (0, true));
    }

    #[test]
    fn lanes() {
        // UADD8: 0xff + 1 carries in lane 0 only.
        assert_eq!(parallel(4, 0x0102_03ff, 0x0101_0101), (0x0203_0400, Some(0b0001)));
        // QADD16: 0x7fff + 1 saturates.
        assert_eq!(parallel(8 + 1, 0x0001_7fff, 0x0001_0001), (0x0002_7fff, None));
        // SASX: high sum, low difference, halves of m exchanged.
        assert_eq!(parallel(16, 0x0005_0007, 0x0003_0002).0, 0x0007_0004);
    }
}
