//! Where in a TOML file something is.

use core::fmt;
use std::ops::Range;

/// Where a value is said to be that the file lacks and that was made up, so that the rest could be read.
pub(crate) const FILLER: Range<usize> = usize::MAX..usize::MAX;

/// A line of a TOML file, and the key that it gives a value to.
///
/// It is written as what follows the file's name in an error: `, line 12, key "id"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Number of the line, from 1 on.
    pub line: usize,
    /// What stands before the `=` of that line, where there is one.
    pub key: Option<String>,
}

impl Place {
    /// The place of a byte range of `text`.
    pub fn of(text: &str, span: Range<usize>) -> Self {
        let before = text.get(..span.start).unwrap_or(text);
        let index = before.matches('\n').count();
        let line = text.lines().nth(index).unwrap_or_default();
        Self { line: index + 1, key: line.split_once('=').map(|(key, _)| key.trim().to_owned()) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, ", line {}", self.line)?;
        self.key.as_ref().map_or(Ok(()), |key| write!(f, ", key \"{key}\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_a_line_and_a_key() {
        let text = "a = 1\n[[joint]]\nid = 3\n";
        let of = |part: &str| {
            let start = text.find(part).unwrap_or_default();
            Place::of(text, start..start + part.len()).to_string()
        };
        assert_eq!(
            ["1", "[[joint]]", "3"].map(of),
            [", line 1, key \"a\"", ", line 2", ", line 3, key \"id\""]
        );
    }
}
