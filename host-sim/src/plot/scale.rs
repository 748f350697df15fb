//! Scales: where their lines are, and how their numbers are written.

/// The step of a scale: 1, 2 or 5 times a power of ten, at least `wanted`.
pub fn step(wanted: f64) -> f64 {
    let power = 10f64.powf(wanted.max(1e-9).log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|&step| step >= wanted);
    step.unwrap_or(10.0 * power)
}

/// The multiples of `step` from `low` to `high`.
pub fn lines(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step).ceil() as i64;
    (first..).map(move |number| number as f64 * step).take_while(move |line| *line <= high + step * 1e-6)
}

/// A value on a scale, with no more decimals than its step has.
pub fn number(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|digit| "0.".contains(digit)) { "0".to_owned() } else { text }
}

/// A number for an axis: 12k instead of 12000, and no more digits than it has.
pub fn short(value: f64) -> String {
    let (value, unit) = match value.abs() {
        size if size >= 1e6 => (value / 1e6, "M"),
        size if size >= 1e3 => (value / 1e3, "k"),
        _ => (value, ""),
    };
    // Three significant digits, without the zeros at the end.
    let digits = (2 - value.abs().max(1e-9).log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{}{unit}", if text == "-0" { "0" } else { text })
}

/// A coordinate in a drawing, to a tenth of its unit.
pub fn tenths(coordinate: f64) -> String {
    format!("{coordinate:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        for (wanted, expected) in
            [(0.3, 0.5), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (7.0, 10.0), (180.0, 200.0)]
        {
            assert!((step(wanted) - expected).abs() < 1e-9, "{wanted}");
        }
    }

    #[test]
    fn lines_are_multiples_within_the_range() {
        assert_eq!(lines(-3.0, 4.0, 2.0).collect::<Vec<_>>(), [-2.0, 0.0, 2.0, 4.0]);
        assert_eq!(lines(0.0, 0.9, 0.3).count(), 4);
    }

    #[test]
    fn numbers_have_the_decimals_of_their_step() {
        assert_eq!(
            (number(0.5, 0.5), number(-0.0, 1.0), number(30.0, 10.0)),
            ("0.5".into(), "0".into(), "30".into())
        );
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.05, "0.05"),
            (0.1 + 0.2, "0.3"),
            (-2.5, "-2.5"),
            (20.0, "20"),
            (1500.0, "1.5k"),
            (12_000.0, "12k"),
            (2e6, "2M"),
            (-1e-12, "0"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
