//! What a file is, by its first bytes: so that an output does not take the place of something else.

use std::path::Path;

/// Bytes that are looked at.
pub(crate) const START_BYTES: usize = 4096;

/// What a file is. Text is told apart as far as one could be lost for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Mclip,
    Glb,
    Elf,
    Png,
    Svg,
    Html,
    Json,
    Bvh,
    Asf,
    Amc,
    GoalLog,
    Csv,
    /// A table of keys, as in TOML.
    Keys,
    Text,
    /// Bytes that do not say what they are: a .qmd, for one.
    Bytes,
}

impl Kind {
    /// The kind of a file with these first bytes; `None` of an empty one.
    pub(crate) fn of(start: &[u8]) -> Option<Self> {
        if start.is_empty() {
            return None;
        }
        let magic = [
            (&b"MCLP"[..], Self::Mclip),
            (b"glTF", Self::Glb),
            (b"\x7fELF", Self::Elf),
            (b"\x89PNG", Self::Png),
        ];
        if let Some((_, kind)) = magic.into_iter().find(|(magic, _)| start.starts_with(magic)) {
            return Some(kind);
        }
        let text = match std::str::from_utf8(start) {
            Ok(text) => text,
            // The last character may be cut.
            Err(error) if error.valid_up_to() + 4 > START_BYTES => {
                std::str::from_utf8(&start[..error.valid_up_to()]).unwrap_or_default()
            }
            Err(_) => return Some(Self::Bytes),
        };
        if text.contains('\0') {
            return Some(Self::Bytes);
        }
        Some(Self::of_text(text.trim_start_matches('\u{feff}')))
    }

    fn of_text(text: &str) -> Self {
        let is_comment = |line: &&str| line.starts_with('#') || line.starts_with("//") || line.is_empty();
        let mut lines = text.lines().map(str::trim).skip_while(is_comment);
        let first = lines.next().unwrap_or_default();
        let lower = first.to_ascii_lowercase();
        let section = |name: &str| text.lines().any(|line| line.trim().eq_ignore_ascii_case(name));
        if lower.starts_with("<!doctype html") || lower.starts_with("<html") {
            Self::Html
        } else if lower.starts_with("<svg") || lower.starts_with("<?xml") {
            Self::Svg
        } else if first.starts_with("HIERARCHY") {
            Self::Bvh
        } else if first.starts_with("time_s,bus,") {
            Self::GoalLog
        } else if first.starts_with(':') {
            if section(":units") || section(":root") { Self::Asf } else { Self::Amc }
        } else if first.starts_with('{') || (first.starts_with('[') && !is_header(first)) {
            Self::Json
        } else if is_header(first) || first.contains('=') {
            Self::Keys
        } else if first.contains([',', ';', '\t']) {
            Self::Csv
        } else {
            Self::Text
        }
    }

    /// In a sentence.
    const fn name(self) -> &'static str {
        match self {
            Self::Mclip => "a .mclip",
            Self::Glb => "a GLB",
            Self::Elf => "an ELF file",
            Self::Png => "a PNG",
            Self::Svg => "an SVG",
            Self::Html => "an HTML page",
            Self::Json => "a JSON file",
            Self::Bvh => "a BVH",
            Self::Asf => "an ASF",
            Self::Amc => "an AMC",
            Self::GoalLog => "a log of goals",
            Self::Csv => "a table (CSV)",
            Self::Keys => "a file of keys and values, such as a puppet's",
            Self::Text => "text",
            Self::Bytes => "no text, and of no kind that is known here",
        }
    }
}

/// Whether a line is a table's header in TOML.
fn is_header(line: &str) -> bool {
    let name = line.trim_start_matches('[').trim_end_matches(']');
    let is_word = |byte: u8| byte.is_ascii_alphanumeric() || b"_-.".contains(&byte);
    line.starts_with('[')
        && line.ends_with(']')
        && !name.is_empty()
        && name.bytes().all(is_word)
        && !name.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
}

/// Why a file that is there must not become one that starts with `new`: `None` where it is of the same kind.
pub(crate) fn in_the_way(path: &Path, there: &[u8], new: &[u8]) -> Option<String> {
    let (found, expected) = (Kind::of(there)?, Kind::of(new).unwrap_or(Kind::Text));
    let is_clip = || decoder_core::qmd::Clip::parse(there, decoder_core::Limits::MAX).is_ok();
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let is_same = found == expected && (found != Kind::Bytes || extension != "qmd" || is_clip());
    // Clips of both kinds are clips, where the name says the new one's.
    let is_clip_too = |a, b| a == Kind::Mclip && b == Kind::Bytes && extension == "qmd";
    if is_same || is_clip_too(found, expected) {
        return None;
    }
    let new = if expected == Kind::Bytes { "a .qmd" } else { expected.name() };
    Some(format!(
        "the file that is there is {}, and would be lost for {new}: remove it, or give another name",
        found.name()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_first_bytes() {
        for (start, kind) in [
            (&b"MCLP\x01\0"[..], Kind::Mclip),
            (b"glTF\x02\0\0\0", Kind::Glb),
            (b"HIERARCHY\nROOT a", Kind::Bvh),
            (b"\n  HIERARCHY\r\n", Kind::Bvh),
            (b"# made by hand\n:version 1.10\n:name a\n:units\n", Kind::Asf),
            (b"#!OML\n:FULLY-SPECIFIED\n:DEGREES\n1\n", Kind::Amc),
            (b"time_s,bus,servo,goal_position\n", Kind::GoalLog),
            (b"time,head.ry\n0,1\n", Kind::Csv),
            (b"{\"servos\": {}}", Kind::Json),
            (b"[[1, 2], [3, 4]]", Kind::Json),
            (b"[[1],[2]]", Kind::Json),
            (b"[1]", Kind::Json),
            (b"# a puppet\n\nservo_hz = 50\n", Kind::Keys),
            (b"[[joint]]\nid = 1\n", Kind::Keys),
            (b"<!DOCTYPE html><title>", Kind::Html),
            (b"<svg width=\"1\">", Kind::Svg),
            (b"Dear diary", Kind::Text),
            (b"ID3\x03\0\0\0", Kind::Bytes),
            (b"\xff\xd8\xff\xe0", Kind::Bytes),
        ] {
            assert_eq!(Kind::of(start), Some(kind), "{}", start.escape_ascii());
        }
        assert_eq!(Kind::of(b""), None);
        let mut long = "ä,".repeat(START_BYTES);
        long.truncate(START_BYTES - 1);
        let cut = [long.as_bytes(), &"ä".as_bytes()[..1]].concat();
        assert_eq!(Kind::of(&cut), Some(Kind::Csv), "the last character may be cut");
    }

    #[test]
    fn another_kind_is_in_the_way() {
        let said = |there: &[u8], new: &[u8], path: &str| in_the_way(Path::new(path), there, new);
        assert_eq!(said(b"", b"MCLP", "a.mclip"), None);
        assert_eq!(said(b"MCLPx", b"MCLP", "a.mclip"), None);
        assert_eq!(said(b"time,a.rx\n", b"time,b.rx\n", "a.csv"), None);
        assert!(said(b"ID3\x03\0", b"\x01\0\0\0", "a.qmd").unwrap().contains("lost for a .qmd"));
        for (there, new) in [
            (&b"ID3\x03\0"[..], &b"MCLP"[..]),
            (b"time,a.rx\n0,1\n", b"time_s,bus,servo,goal_position\n"),
            (b":units\n:root\n", b"servo_hz = 50\n"),
            (b"Dear diary", b"time_s,bus,servo,goal_position\n"),
            (b"HIERARCHY\n", b"{\"a\":1}"),
        ] {
            assert!(said(there, new, "a").unwrap().starts_with("the file that is there is"));
        }
        let clip = mocap::sample::clip();
        let (parameters, method) = (encoder::qmd::Parameters::TABLE_1, encoder::qmd::Method::ClosedLoop);
        let qmd = encoder::qmd::encode(&clip, parameters, method).unwrap();
        assert_eq!(said(&qmd, &qmd, "a.qmd"), None);
    }
}
