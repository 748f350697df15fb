//! Frame rates as files print them.

/// Frames per second of a frame time that is printed as `digits`.
///
/// A whole number if that rounds to the digits, else a whole number × 1000 / 1001 (the NTSC rates); of the digits there
/// must be three for either to mean something.
pub(super) fn of_frame_time(frame_time: f64, digits: &str) -> f64 {
    let mantissa = digits.split(['e', 'E']).next().unwrap_or(digits);
    let significant = mantissa.trim_start_matches(['0', '.', '+']).bytes().filter(u8::is_ascii_digit).count();
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent: i32 = digits.split_once(['e', 'E']).and_then(|(_, text)| text.parse().ok()).unwrap_or(0);
    let half_a_digit = 0.5 * 10_f64.powi(exponent.saturating_sub(decimals as i32));
    if significant < 3 {
        return 1.0 / frame_time;
    }
    near(frame_time, half_a_digit * 1.000_001)
}

/// Frames per second of a frame time that is known to within `slack` seconds: a whole number, else an NTSC rate, where one
/// is as near as that.
pub(super) fn near(frame_time: f64, slack: f64) -> f64 {
    let fits = |fps: &f64| (1.0 / fps - frame_time).abs() <= slack;
    let whole = (1.0 / frame_time).round();
    let ntsc = [24.0, 30.0, 48.0, 60.0, 120.0, 240.0].map(|whole| whole * 1000.0 / 1001.0);
    let mut meant = [whole].into_iter().filter(|&whole| whole >= 1.0).chain(ntsc);
    meant.find(fits).unwrap_or(1.0 / frame_time)
}

/// Times that are off a steady rate by less than this part of a frame are steady: those in whole milliseconds mostly are.
const STEADY: f64 = 0.1;

/// Frames per second of ascending times in seconds, and whether they are steady: else it is the whole number nearest to the
/// median of the rates between two. Nothing where there are fewer than two.
pub(super) fn of_times(times: &[f64]) -> Option<(f64, bool)> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = *steps.get(steps.len() / 2)?;
    let mean = (times.last()? - times[0]) / steps.len() as f64;
    let off = times.iter().enumerate().map(|(row, time)| (time - times[0] - row as f64 * mean).abs());
    let off = off.fold(0.0, f64::max);
    if off > STEADY * mean {
        return Some(((1.0 / median).round().max(1.0), false));
    }
    // All steps together say the rate more exactly than one; times are 32-bit floats in some files.
    Some((near(mean, 2.0 * off / steps.len() as f64 + 1e-7 * mean), true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_what_the_digits_mean() {
        for (digits, fps) in [
            (".0083333", 120.0),
            ("0.00833333", 120.0),
            ("0.010000", 100.0),
            ("0.0333333", 30.0),
            ("4.16667e-2", 24.0),
            (".04", 25.0),
            ("1", 1.0),
            ("0.0334", 30_000.0 / 1001.0),
            ("0.0417083", 24_000.0 / 1001.0),
            ("0.0417", 24.0),
            ("0.0166833", 60_000.0 / 1001.0),
            ("0.0335", 1.0 / 0.0335),
            ("0.03", 1.0 / 0.03),
        ] {
            assert_eq!(of_frame_time(digits.parse().expect("a number"), digits), fps, "{digits}");
        }
    }
}
