//! Reading text by bytes: words, numbers and line ends, with the line for a message.

use super::error::ImportError;

/// Fails on a file that is empty or is no text at all, such as a picture.
pub(super) fn check(bytes: &[u8], file: &str, expected: &str) -> Result<(), ImportError> {
    let binary = |byte: &u8| byte.is_ascii_control() && !is_blank(*byte) && *byte != b'\n';
    let found = if let Some(offset) = bytes.iter().take(4096).position(binary) {
        format!("byte {:#04x} at offset {offset}, which is not text", bytes[offset])
    } else if bytes.iter().all(|&byte| is_blank(byte) || byte == b'\n') {
        "an empty file".to_string()
    } else {
        return Ok(());
    };
    Err(ImportError::File { file: file.to_string(), found, expected: expected.to_string() })
}

/// Blanks within a line. `\x1a` is what MS-DOS programs end a text file with.
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\x0b' | b'\x0c' | b'\x1a')
}

/// A cursor over the bytes of a text file.
#[derive(Clone)]
pub(super) struct Lexer<'a> {
    file: &'a str,
    bytes: &'a [u8],
    at: usize,
    line: usize,
    /// A byte from which the rest of a line is a comment.
    comment: Option<u8>,
    /// Bytes that are words by themselves.
    marks: &'static [u8],
}

impl<'a> Lexer<'a> {
    pub(super) fn new(bytes: &'a [u8], file: &'a str, comment: Option<u8>, marks: &'static [u8]) -> Self {
        let byte_order_mark = b"\xef\xbb\xbf";
        let at = if bytes.starts_with(byte_order_mark) { byte_order_mark.len() } else { 0 };
        Self { file, bytes, at, line: 1, comment, marks }
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Goes to the next word of this line, or to its end, which is answered with true.
    #[inline]
    pub(super) fn at_line_end(&mut self) -> bool {
        while let Some(byte) = self.peek() {
            if byte == b'\n' {
                return true;
            } else if Some(byte) == self.comment {
                self.skip_line();
                return true;
            } else if !is_blank(byte) {
                return false;
            }
            self.at += 1;
        }
        true
    }

    /// Goes to the next word, over line ends; false at the end of the file.
    #[inline]
    pub(super) fn find_word(&mut self) -> bool {
        while self.at_line_end() {
            if self.at >= self.bytes.len() {
                return false;
            }
            self.at += 1;
            self.line += 1;
        }
        true
    }

    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
    }

    /// The word at the cursor, without going over it; empty at the end of a line.
    #[inline]
    pub(super) fn word(&self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        if rest.first().is_some_and(|byte| self.marks.contains(byte)) {
            return &rest[..1];
        }
        let ends = |byte: &u8| is_blank(*byte) || *byte == b'\n' || self.marks.contains(byte);
        &rest[..rest.iter().position(ends).unwrap_or(rest.len())]
    }

    /// Goes over the word at the cursor.
    #[inline]
    pub(super) fn take_word(&mut self) -> &'a [u8] {
        let word = self.word();
        self.at += word.len();
        word
    }

    /// Goes over the next word, over line ends, if it is this one in any case of letters.
    pub(super) fn accept(&mut self, keyword: &str) -> bool {
        let found = self.find_word() && self.word().eq_ignore_ascii_case(keyword.as_bytes());
        if found {
            self.at += keyword.len();
        }
        found
    }

    /// Goes over the next word, which must be this one in any case of letters.
    pub(super) fn expect(&mut self, keyword: &str) -> Result<(), ImportError> {
        if self.accept(keyword) { Ok(()) } else { Err(self.error(format!("`{keyword}`"))) }
    }

    /// Goes over the rest of the line up to a brace; without the blanks around it.
    ///
    /// In a line that is not UTF-8, a brace behind a byte from 0x80 on belongs to the name: in Shift-JIS and GBK it is the
    /// second half of a letter.
    pub(super) fn take_name(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let line = &rest[..rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len())];
        let utf8 = str::from_utf8(line).is_ok();
        let is_brace =
            |at: usize| matches!(line[at], b'{' | b'}') && (utf8 || at == 0 || line[at - 1] < 0x80);
        let name = &line[..(0..line.len()).find(|&at| is_brace(at)).unwrap_or(line.len())];
        self.at += name.len();
        name.trim_ascii()
    }

    /// Number of the line of the cursor, from 1.
    pub(super) const fn line(&self) -> usize {
        self.line
    }

    /// The finite number at the cursor, within this line.
    #[inline]
    pub(super) fn number(&mut self, expected: impl FnOnce() -> String) -> Result<f64, ImportError> {
        if !self.at_line_end() {
            let rest = &self.bytes[self.at..];
            if let Ok((value, length)) = fast_float2::parse_partial::<f64, _>(rest)
                && value.is_finite()
                && rest.get(length).is_none_or(|&byte| is_blank(byte) || byte == b'\n')
            {
                self.at += length;
                return Ok(value);
            }
        }
        Err(self.error(expected()))
    }

    /// An error about what is at the cursor.
    pub(super) fn error(&self, expected: String) -> ImportError {
        let found = match self.peek() {
            None => "the end of the file".to_string(),
            Some(b'\n') => "the end of the line".to_string(),
            Some(_) => quote(self.word()),
        };
        self.error_found(found, expected)
    }

    /// An error in the line of the cursor.
    pub(super) fn error_found(&self, found: String, expected: String) -> ImportError {
        ImportError::Line { file: self.file.to_string(), line: self.line, found, expected }
    }
}

/// A name as text. Where it is not UTF-8, every byte from 0x80 on becomes `%` and two hexadecimal digits: which encoding
/// it is in, nothing says, and names that differ must stay different.
pub(super) fn name(bytes: &[u8]) -> String {
    match str::from_utf8(bytes) {
        Ok(text) => text.trim().to_string(),
        Err(_) => {
            let one =
                |&byte: &u8| if byte < 0x80 { char::from(byte).to_string() } else { format!("%{byte:02X}") };
            bytes.iter().map(one).collect()
        }
    }
}

/// A word from a file as a message shows it: quoted, and not longer than a message should be.
pub(super) fn quote(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(&word[..word.len().min(200)]);
    let short: String = text.chars().take(40).collect();
    let more = if short.len() < word.len() { "…" } else { "" };
    format!("`{}{more}`", short.escape_debug())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Result<f64, ImportError> {
        Lexer::new(text.as_bytes(), "x.amc", Some(b'#'), b"").number(|| "a number".to_string())
    }

    #[test]
    fn numbers_of_every_notation() {
        for (text, value) in [
            ("3.64024e-015", 3.64024e-15),
            ("-2.88238E-015\r\n", -2.88238e-15),
            (".0083333", 0.0083333),
            ("5. ", 5.0),
            ("+7", 7.0),
            ("-0", 0.0),
            ("123456789012345678901234567890", 123456789012345678901234567890.0),
            ("  \t12", 12.0),
        ] {
            assert_eq!(number(text).expect(text), value, "{text}");
        }
        for text in
            ["", "nan", "inf", "-inf", "1e999", "1,5", "1.5x", "--1", "1.#QNAN", ".", "0x10", "\n5", "#5"]
        {
            assert!(number(text).is_err(), "{text}");
        }
    }

    #[test]
    fn messages_are_short() {
        let error = number(&"x".repeat(100_000)).expect_err("no number").to_string();
        assert!(error.len() < 120, "{error}");
    }
}
