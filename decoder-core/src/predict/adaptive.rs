//! The adaptive predictor of second order, by the autocorrelation method (7-15 to 7-18).
//!
//! It predicts the movement d(n) = x(n) − x(n − 1) from the two before it: θ in (7-15) is the movement. Joint
//! angles have a mean that the method cannot model (it would pull every prediction towards zero); movements have
//! none. The prediction of the value is then x(n − 1) + α₁ · d(n − 1) + α₂ · d(n − 2).
//!
//! The short-term autocorrelation is taken over an exponential window of 2^s samples, so that a channel needs three
//! sums instead of a window of decoded samples: 16 bytes, where a window of 15 to 120 samples takes 30 to 240. The
//! coefficients are solved for once in a period, by Levinson's recursion with both reflection coefficients bounded,
//! so that α₁ and α₂ are a stable filter whatever the sums are. That costs two divisions.

/// A coefficient of 1.
pub const ONE: i16 = 1 << 14;

/// Largest magnitude of a reflection coefficient: 15/16.
pub const MAX_REFLECTION: i32 = 15 << 10;

/// Movements are kept in 512ths of a unit, up to 8 units a frame: in 13 bits, so that a window of their products is in
/// a word.
const SHIFT: u32 = 7;

/// Largest movement that is kept.
const MOST: i32 = (1 << 12) - 1;

/// R(0) below which there was too little movement to say: sums do not decay to zero.
const LEAST: i32 = 256;

/// Largest s of a window of 2^s samples.
pub const MAX_WINDOW: u8 = 6;

/// The movement, as far as it is kept, where the next decoded value is `difference` above the last one.
#[inline(always)]
pub fn movement(difference: i32) -> i16 {
    (difference >> SHIFT).clamp(!MOST, MOST) as i16
}

/// What the prediction is above the last value, by the coefficients α₁ and α₂ and the movements d(n − 1) and d(n − 2). Two
/// 16-bit multiplies.
#[inline(always)]
pub const fn predict([first, second]: [i16; 2], [newest, before]: [i16; 2]) -> i32 {
    // Below 2^28 each.
    let first = (first as i32).wrapping_mul(newest as i32);
    let second = (second as i32).wrapping_mul(before as i32);
    first.wrapping_add(second) >> (14 - SHIFT)
}

/// The products of a movement with itself and with the two before it.
#[inline(always)]
fn products(movement: i16, [newest, before]: [i16; 2]) -> [i32; 3] {
    [movement, newest, before].map(|other| i32::from(movement).wrapping_mul(i32::from(other)))
}

/// The coefficients α₁ and α₂ that solve (7-16) for R(0), R(1) and R(2), as far as the bound on reflection coefficients
/// lets them; both 0 where there was too little movement to say.
pub fn solve([r0, r1, r2]: [i32; 3]) -> [i16; 2] {
    if r0 < LEAST {
        return [0, 0];
    }
    // R(0) in 15 bits, the others with it. R(1) and R(2) are kept below R(0), as those of a signal are.
    let shift = 17u32.saturating_sub(r0.leading_zeros());
    let (r0, r1, r2) = (r0 >> shift, r1 >> shift, r2 >> shift);
    let (r1, r2) = (clamp(r1, r0), clamp(r2, r0));
    let first = ratio(r1, r0);
    let error = r0.wrapping_sub(first.wrapping_mul(r1) >> 14).max(1);
    let second = ratio(r2.wrapping_sub(first.wrapping_mul(r1) >> 14), error);
    let both = first.wrapping_mul(second) >> 14;
    // Below 2 and 1 in magnitude, so they fit.
    [first.wrapping_sub(both) as i16, second as i16]
}

/// A channel's two last movements and its autocorrelation over an exponential window, in words that the caller lends: all 0
/// where it has not moved.
///
/// The first word has the movements d(n − 1), in its lower half, and d(n − 2); the others are R(0), R(1) and R(2), sums of
/// products that decay, below 2³¹ in magnitude.
#[derive(Debug)]
pub struct Correlation<'w>(pub &'w mut [u32; CORRELATION_WORDS]);

/// Words of a [`Correlation`].
pub const CORRELATION_WORDS: usize = 4;

impl Correlation<'_> {
    /// d(n − 1) and d(n − 2).
    #[inline(always)]
    pub const fn movements(&self) -> [i16; 2] {
        let [movements, ..] = *self.0;
        unpair(movements.cast_signed())
    }

    /// R(0), R(1) and R(2) of the channel that has these words.
    #[inline(always)]
    pub fn sums(words: &[u32; CORRELATION_WORDS]) -> [i32; 3] {
        let &[_, r0, r1, r2] = words;
        [r0, r1, r2].map(u32::cast_signed)
    }

    /// Takes in a [movement]. `window` is s, 1 to [`MAX_WINDOW`]. Three 16-bit multiplies.
    #[inline(always)]
    pub fn add(&mut self, movement: i16, window: u32) {
        let [movements, r0, r1, r2] = *self.0;
        let last = unpair(movements.cast_signed());
        let [newest, _] = last;
        let [p0, p1, p2] = products(movement, last);
        // Products are at most 2^24 in magnitude, so sums are at most 2^30 + 2^24.
        let decayed = |word: u32, product: i32| {
            let sum = word.cast_signed();
            // In this order, the sum may be shifted in its register.
            sum.wrapping_add(product).wrapping_sub(sum.wrapping_shr(window)).cast_unsigned()
        };
        let movements = pair([movement, newest]).cast_unsigned();
        *self.0 = [movements, decayed(r0, p0), decayed(r1, p1), decayed(r2, p2)];
    }
}

/// Two coefficients in a word.
#[inline(always)]
pub const fn pair([first, second]: [i16; 2]) -> i32 {
    (first as i32 & 0xffff) | (second as i32).wrapping_shl(16)
}

/// The two coefficients of a word.
#[inline(always)]
pub const fn unpair(word: i32) -> [i16; 2] {
    [word as i16, (word >> 16) as i16]
}

fn clamp(value: i32, most: i32) -> i32 {
    value.max(most.wrapping_neg()).min(most)
}

/// A reflection coefficient: the ratio in 16384ths, bounded. `over` is 1 to 2¹⁵.
fn ratio(value: i32, over: i32) -> i32 {
    let value = clamp(value, over).wrapping_mul(i32::from(ONE));
    clamp(value.checked_div(over).unwrap_or(0), MAX_REFLECTION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Random, times};

    fn solved(sums: [i32; 3]) -> [f64; 2] {
        solve(sums).map(|c| f64::from(c) / f64::from(ONE))
    }

    #[test]
    fn coefficients_solve_the_normal_equations() {
        let mut random = Random::new(6);
        for _ in 0..times(100_000, 300) {
            // Of a stable filter, so that the bounds do not matter.
            let k = [0; 2].map(|_| (random.below(1800) as f64 - 900.0) / 1000.0);
            let r0 = f64::from(1000 + (random.next() >> 3));
            let r1 = k[0] * r0;
            let r2 = k[0] * r1 + k[1] * (r0 - k[0] * r1);
            let [first, second] = solved([r0 as i32, r1 as i32, r2 as i32]);
            // (7-16) by Cramer's rule.
            let determinant = r0 * r0 - r1 * r1;
            let exact = [(r1 * r0 - r1 * r2) / determinant, (r0 * r2 - r1 * r1) / determinant];
            // Sums of at least 9 bits.
            assert!(
                (first - exact[0]).abs() < 0.06 && (second - exact[1]).abs() < 0.06,
                "{k:?} {first} {second} {exact:?}"
            );
        }
    }

    #[test]
    fn coefficients_are_stable_for_any_sums() {
        let mut random = Random::new(7);
        for _ in 0..times(1_000_000, 500) {
            let any = |random: &mut Random| random.next() as i32 >> (2 + random.below(30));
            let sums = [any(&mut random).abs(), any(&mut random), any(&mut random)];
            let [first, second] = solved(sums);
            assert!(second.abs() < 1.0 && first.abs() < 1.0 - second, "{sums:?} {first} {second}");
        }
    }

    #[test]
    fn sums_stay_in_range_for_any_movement() {
        let mut random = Random::new(8);
        for window in 1..=u32::from(MAX_WINDOW) {
            let mut words = [0; CORRELATION_WORDS];
            for step in 0..times(20_000, 80) {
                let movement = match step / times(1000, 20) % 4 {
                    0 => i32::MIN,
                    1 => i32::MAX,
                    2 => random.next() as i32,
                    _ => {
                        if step % 2 == 0 {
                            i32::MIN
                        } else {
                            i32::MAX
                        }
                    }
                };
                Correlation(&mut words).add(super::movement(movement), window);
                let [r0, r1, r2] = Correlation::sums(&words);
                let most = (1 << 30) + (1 << 24);
                assert!((0..=most).contains(&r0) && r1.abs() <= most && r2.abs() <= most);
                predict(solve(Correlation::sums(&words)), Correlation(&mut words).movements());
            }
        }
    }

    /// A damped oscillation is predicted far better than by repeating its last movement.
    #[test]
    fn it_learns_an_oscillation() {
        let mut words = [0; CORRELATION_WORDS];
        let (mut own, mut naive) = (0.0, 0.0);
        let mut before = [0; 2];
        for n in 0..2000 {
            let x = ((f64::from(n) * 0.3).sin() * 20.0 * 65536.0) as i32;
            if n > 200 {
                let expected = predict(solve(Correlation::sums(&words)), Correlation(&mut words).movements());
                own += f64::from(before[0] + expected - x).abs();
                naive += f64::from(2 * before[0] - before[1] - x).abs();
            }
            Correlation(&mut words).add(movement(x - before[0]), 5);
            before = [x, before[0]];
        }
        assert!(own < naive / 2.0, "{own} {naive}");
    }

    #[test]
    fn pairs_are_taken_apart_again() {
        for pairs in [[0, 0], [-1, 1], [i16::MIN, i16::MAX], [i16::MAX, i16::MIN], [5, -5]] {
            assert_eq!(unpair(pair(pairs)), pairs);
        }
    }
}
