//! Quantisers of least mean squared error for a known density: Lloyd's and Max's.
//!
//! J. Max, "Quantizing for minimum distortion", IRE Transactions on Information Theory 6 (1960), which section 7.2
//! of the waveform-coding document points to: every decision level is in the middle of two levels of reconstruction,
//! and every one of these is the mean of what falls between its decision levels. The tables are those of the density of
//! variance 1; a channel's step brings them to its own. Both densities are symmetric, so the half above 0 says all.

use std::f64::consts::{PI, SQRT_2};

/// A density of mean 0 and variance 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Density {
    /// exp(−x²/2) / √(2π).
    Gaussian,
    /// exp(−√2·|x|) / √2, as differences in predictive coding often have (7.2.2).
    Laplacian,
}

/// Lloyd's iteration ends where no level moves further in a round.
const STILL: f64 = 1e-9;

/// Most rounds. Tables of 8 bits are within 1e-5 by then, a fifth of a step of the clip's table.
const ROUNDS: usize = 20_000;

impl Density {
    /// The probability of a value above `x`, which is at least 0.
    fn above(self, x: f64) -> f64 {
        match self {
            Self::Gaussian => libm::erfc(x / SQRT_2) / 2.0,
            Self::Laplacian => (-SQRT_2 * x).exp() / 2.0,
        }
    }

    /// The integral of t · p(t) above `x`, which is at least 0.
    fn moment_above(self, x: f64) -> f64 {
        match self {
            Self::Gaussian => (-x * x / 2.0).exp() / (2.0 * PI).sqrt(),
            Self::Laplacian => (x + 1.0 / SQRT_2) * self.above(x),
        }
    }

    /// A start near the optimum: levels as dense as the cube root of the density (Panter and Dite), by the inverse of
    /// its own distribution, which has the same shape at √3 times the width (Gaussian) or 3 times (Laplacian).
    fn start(self, part: f64) -> f64 {
        match self {
            // The logistic curve is near enough to the normal distribution's.
            Self::Gaussian => 3f64.sqrt() / 1.702 * ((1.0 + part) / (1.0 - part)).ln(),
            Self::Laplacian => -3.0 / SQRT_2 * (1.0 - part).ln(),
        }
    }

    /// The levels of reconstruction of the best quantiser of `count` levels, ascending.
    ///
    /// Costs at most 20,000 rounds of `count` exponentials.
    pub fn levels(self, count: usize) -> Vec<f64> {
        let half = count / 2;
        let odd = !count.is_multiple_of(2);
        let mut levels: Vec<f64> =
            (0..half).map(|i| self.start((2 * i + 1 + usize::from(odd)) as f64 / count as f64)).collect();
        for _ in 0..ROUNDS {
            // Of an odd number of levels, one is 0.
            let mut low = if odd { levels.first().copied().unwrap_or(0.0) / 2.0 } else { 0.0 };
            let mut moved = 0.0_f64;
            for i in 0..half {
                let (above, moment) = match levels.get(i + 1) {
                    Some(next) => {
                        let high = f64::midpoint(levels[i], *next);
                        (self.above(low) - self.above(high), self.moment_above(low) - self.moment_above(high))
                    }
                    None => (self.above(low), self.moment_above(low)),
                };
                low = levels.get(i + 1).map_or(low, |next| f64::midpoint(levels[i], *next));
                let mean = moment / above;
                moved = moved.max((mean - levels[i]).abs());
                levels[i] = mean;
            }
            if moved < STILL {
                break;
            }
        }
        let below = levels.iter().rev().map(|level| -level);
        below.chain(odd.then_some(0.0)).chain(levels.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean squared error of these levels for the density, by Simpson's rule out to 40 deviations.
    fn error(density: Density, levels: &[f64]) -> f64 {
        let p = |x: f64| match density {
            Density::Gaussian => (-x * x / 2.0).exp() / (2.0 * PI).sqrt(),
            Density::Laplacian => (-SQRT_2 * x.abs()).exp() / SQRT_2,
        };
        let mut edges: Vec<f64> = levels.windows(2).map(|pair| f64::midpoint(pair[0], pair[1])).collect();
        edges.insert(0, -40.0);
        edges.push(40.0);
        let mut sum = 0.0;
        for (pair, level) in edges.windows(2).zip(levels) {
            // A Laplacian has an edge at 0, so no panel goes across it.
            let parts = if pair[0] < 0.0 && pair[1] > 0.0 {
                vec![(pair[0], 0.0), (0.0, pair[1])]
            } else {
                vec![(pair[0], pair[1])]
            };
            for (low, high) in parts {
                let f = |x: f64| (x - level).powi(2) * p(x);
                let panels = 4000;
                let h = (high - low) / f64::from(panels);
                for i in 0..panels {
                    let a = low + f64::from(i) * h;
                    sum += h / 6.0 * (f(a) + 4.0 * f(a + h / 2.0) + f(a + h));
                }
            }
        }
        sum
    }

    /// The levels above 0 and the error, to the places that were printed.
    fn check(density: Density, count: usize, printed: &[f64], printed_error: f64) {
        let levels = density.levels(count);
        assert_eq!(levels.len(), count);
        let above: Vec<f64> = levels.iter().copied().filter(|&level| level > 1e-12).collect();
        assert_eq!(above.len(), printed.len());
        for (found, printed) in above.iter().zip(printed) {
            assert!((found - printed).abs() < 1e-3, "{density:?} {count}: {above:?} {printed:?}");
        }
        let found = error(density, &levels);
        assert!((found / printed_error - 1.0).abs() < 5e-3, "{density:?} {count}: error {found}");
    }

    /// Max 1960, table I.
    #[test]
    fn gaussian_levels_are_those_that_max_printed() {
        check(Density::Gaussian, 1, &[], 1.0);
        check(Density::Gaussian, 2, &[0.7980], 0.3634);
        check(Density::Gaussian, 3, &[1.224], 0.1902);
        check(Density::Gaussian, 4, &[0.4528, 1.510], 0.1175);
        check(Density::Gaussian, 5, &[0.7646, 1.724], 0.07994);
        check(Density::Gaussian, 7, &[0.5606, 1.188, 2.033], 0.04400);
        check(Density::Gaussian, 8, &[0.2451, 0.7560, 1.344, 2.152], 0.03454);
        let sixteen = [0.1284, 0.3881, 0.6568, 0.9424, 1.256, 1.618, 2.069, 2.733];
        check(Density::Gaussian, 16, &sixteen, 0.009497);
    }

    /// Jayant and Noll, Digital Coding of Waveforms (1984), chapter 4, for the Laplacian density.
    #[test]
    fn laplacian_levels_are_those_that_were_printed() {
        check(Density::Laplacian, 2, &[0.707], 0.5);
        check(Density::Laplacian, 4, &[0.420, 1.834], 0.1762);
        check(Density::Laplacian, 8, &[0.233, 0.833, 1.673, 3.087], 0.0545);
        let sixteen = [0.124, 0.405, 0.729, 1.111, 1.578, 2.178, 3.017, 4.432];
        check(Density::Laplacian, 16, &sixteen, 0.0154);
    }

    /// Panter and Dite's error for many levels: (∫ p^(1/3))³ / 12 N², that is 2.721 / N² and 4.5 / N².
    #[test]
    fn large_tables_have_the_error_that_theory_gives() {
        for (density, constant) in [(Density::Gaussian, PI * 3f64.sqrt() / 2.0), (Density::Laplacian, 4.5)] {
            let found = error(density, &density.levels(256)) * 256.0 * 256.0;
            assert!((found / constant - 1.0).abs() < 0.02, "{density:?}: {found}, expected {constant}");
        }
    }
}
