//! Numbers as text.

use std::io::{self, Write};

/// Writes the shortest number that rounds to the same 15 significant digits: every decimal number of up to
/// 15 digits that was read and scaled comes back as it was.
pub(super) fn write_number(out: &mut impl Write, value: f64) -> io::Result<()> {
    let shortest = format!("{value:e}");
    let digits = shortest.bytes().take_while(|byte| *byte != b'e').filter(u8::is_ascii_digit).count();
    let value = if digits <= 15 { value } else { format!("{value:.14e}").parse().unwrap_or(value) };
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) {
        write!(out, "{value}")
    } else {
        write!(out, "{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(value: f64) -> String {
        let mut out = Vec::new();
        write_number(&mut out, value).expect("a Vec takes it");
        String::from_utf8(out).expect("digits")
    }

    #[test]
    fn decimals_survive_scaling() {
        let unit = 2.54 / 0.45;
        for printed in ["12.7274", "-2.88238e-15", "0", "-91.3333", "0.00001", "123456789.012345"] {
            let value: f64 = printed.parse().expect("a number");
            assert_eq!(text(value * unit / unit), printed);
        }
    }
}
