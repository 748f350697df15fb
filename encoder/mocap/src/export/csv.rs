//! CSV: one row per frame, for spreadsheets and scripts.

use std::io::Write;

use super::error::{ExportError, check_channels};
use super::number::write_number;
use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// Writes a header row, `time` and the channels' names, then per frame its time in seconds and its values in
/// degrees and centimetres.
///
/// # Errors
/// A motion that does not fit the skeleton, an output that fails.
pub fn write(out: &mut impl Write, skeleton: &Skeleton, motion: &Motion) -> Result<(), ExportError> {
    check_channels(skeleton, motion)?;
    write_named(out, skeleton.channels.iter().map(|channel| channel.name.as_str()), motion)
}

/// As [`write`](fn@write), for a motion without a skeleton, whose channels have these names.
///
/// # Errors
/// An output that fails.
pub fn write_named<'n>(
    out: &mut impl Write,
    names: impl IntoIterator<Item = &'n str>,
    motion: &Motion,
) -> Result<(), ExportError> {
    write!(out, "time")?;
    for name in names {
        write!(out, ",{}", quoted(name))?;
    }
    out.write_all(b"\n")?;
    for (frame, pose) in motion.iter().enumerate() {
        write_number(out, frame as f64 / motion.fps)?;
        for &value in pose {
            out.write_all(b",")?;
            write_number(out, value)?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// A field as RFC 4180 has it: in quotes if it holds a separator or a quote.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn one_row_per_frame_and_one_column_per_channel() {
        let mut clip = sample::clip();
        clip.skeleton.channels[0].name = "a,\"b\"".to_string();
        let mut out = Vec::new();
        write(&mut out, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        let text = String::from_utf8(out).expect("text");
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), clip.motion.frames() + 1);
        assert!(rows[0].starts_with("time,\"a,\"\"b\"\"\",root.ty,"), "{}", rows[0]);
        for (frame, row) in rows[1..].iter().enumerate() {
            let values: Vec<f64> = row.split(',').map(|field| field.parse().expect("a number")).collect();
            assert!((values[0] - frame as f64 / 60.0).abs() < 1e-12);
            assert_eq!(&values[1..], clip.motion.frame(frame));
        }
    }
}
