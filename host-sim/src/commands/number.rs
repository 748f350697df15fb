//! Numbers as arguments: each within a range, which the error names. What is no number, or not finite, is outside of all.

use std::ops::RangeInclusive;

/// A number within a range, of what `what` says.
fn within(text: &str, what: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("found {text:?}, expected {what}, {} to {}", range.start(), range.end()))
}

/// A size or an error, which no sensible one is above.
pub fn above_zero(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|&number| number > 0.0 && number <= 1e9);
    number.ok_or_else(|| format!("found {text:?}, expected a number above 0, at most 1000000000"))
}

/// A bound, which may be 0.
pub fn from_zero(text: &str) -> Result<f64, String> {
    within(text, "a number", 0.0..=1e9)
}

/// Frames per second of a recording.
pub fn recorded_rate(text: &str) -> Result<f64, String> {
    within(text, "frames per second", 0.001..=1e6)
}

/// Frames per second that a clip is played at.
pub fn played_rate(text: &str) -> Result<f64, String> {
    within(text, "frames per second", 0.01..=655.35)
}

/// How many times as fast as recorded.
pub fn speed(text: &str) -> Result<f64, String> {
    within(text, "a factor", 0.25..=4.0)
}

/// A time: up to eleven days.
pub fn seconds(text: &str) -> Result<f64, String> {
    within(text, "seconds", 0.0..=1e6)
}

/// Time without a frame.
pub fn seconds_of_silence(text: &str) -> Result<f64, String> {
    within(text, "seconds", 0.0..=60.0)
}

/// Time that a servo takes to answer.
pub fn microseconds(text: &str) -> Result<f64, String> {
    within(text, "microseconds", 0.0..=1e6)
}

/// A part of a time.
pub fn percent(text: &str) -> Result<f64, String> {
    within(text, "percent", 0.0..=100.0)
}

/// An angle, or centimetres of a joint that slides: the range of the joint itself is told where the puppet is known.
pub fn angle(text: &str) -> Result<f64, String> {
    within(text, "degrees (cm of a joint that slides)", -36_000.0..=36_000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_is_told_with_its_range() {
        type Parser = fn(&str) -> Result<f64, String>;
        let all: [Parser; 10] = [
            above_zero,
            from_zero,
            recorded_rate,
            played_rate,
            speed,
            seconds,
            seconds_of_silence,
            microseconds,
            percent,
            angle,
        ];
        for parser in all {
            assert_eq!(parser("1"), Ok(1.0));
            for text in
                ["nan", "NaN", "inf", "-inf", "infinity", "1e999", "-1e12", "1e12", "", "x", "1,5", "0x1"]
            {
                let said = parser(text).unwrap_err();
                assert!(said.starts_with(&format!("found {text:?}, expected ")), "{said}");
                assert!(said.bytes().filter(u8::is_ascii_digit).count() > 1, "no range: {said}");
            }
        }
        assert!(above_zero("0").is_err() && above_zero("-1").is_err() && above_zero("1e-9").is_ok());
        assert!(from_zero("0").is_ok() && from_zero("-0.1").is_err());
        assert_eq!(
            played_rate("0.001").unwrap_err(),
            "found \"0.001\", expected frames per second, 0.01 to 655.35"
        );
        assert!(angle("-30").is_ok());
    }
}
