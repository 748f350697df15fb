//! CSV tables: one row per frame, one named column per channel.
//!
//! The first row has the columns' names. A column `time` (also `t`, `time_s`, `seconds`, `timestamp`) is in seconds; without
//! one, a column `frame` is skipped, and the caller gives the rate. Any other column is a channel: `joint.rx` to `joint.rz`
//! in degrees, `joint.tx` to `joint.tz` in centimetres, `joint.goal` in goals of a servo. A name alone is a rotation in
//! degrees, unless the caller says another unit or the name ends in `_rad`. Fields are separated by commas, semicolons or
//! tabs, with decimal points.

use super::error::ImportError;
use super::imported::Imported;
use super::options::Options;
use super::text::{self, quote};
use super::timed::Timed;
use super::values::{self, Values};

/// Names of a column of times in seconds.
pub(super) const TIME: [&str; 7] = ["time", "t", "times", "time_s", "seconds", "timestamp", "timestamps"];

/// Parses a table: `file` is its name for messages.
///
/// # Errors
/// Names the line, what was found there and what was expected.
pub fn parse(bytes: &[u8], file: &str, options: &Options) -> Result<Imported, ImportError> {
    text::check(bytes, file, "a CSV table")?;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let first = bytes.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let separator =
        *b",;\t".iter().max_by_key(|mark| first.iter().filter(|byte| byte == mark).count()).unwrap_or(&b',');
    let mut reader = csv::ReaderBuilder::new().delimiter(separator).trim(csv::Trim::All).from_reader(bytes);
    let wrong = |line: u64, found: String, expected: String| {
        Err(ImportError::Line { file: file.to_string(), line: line as usize, found, expected })
    };
    let malformed = |error: csv::Error| ImportError::Line {
        file: file.to_string(),
        line: error.position().map_or(1, |position| position.line() as usize),
        found: match error.kind() {
            csv::ErrorKind::UnequalLengths { len, .. } => format!("{len} fields"),
            _ => "text that is no table".to_string(),
        },
        expected: "as many fields as the first row has names, in UTF-8".to_string(),
    };
    let names = reader.headers().map_err(malformed)?.clone();
    if names.iter().any(|name| name.parse::<f64>().is_ok()) {
        return wrong(
            1,
            "numbers".to_string(),
            "the names of the columns, such as `time` and `head.ry`".to_string(),
        );
    }
    let is_time = |name: &str| TIME.iter().any(|time| name.eq_ignore_ascii_case(time));
    let time = names.iter().position(is_time);
    let frame = names.iter().position(|name| name.eq_ignore_ascii_case("frame"));
    let is_channel = |column: usize| Some(column) != time && Some(column) != frame;
    let columns = names.iter().enumerate().filter(|(column, _)| is_channel(*column));
    let mut columns: Vec<String> = columns.map(|(_, name)| name.to_string()).collect();
    let (mut times, mut samples) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(malformed)?;
        let line = record.position().map_or(1, csv::Position::line);
        for (column, field) in record.iter().enumerate() {
            let value = field.parse::<f64>().ok().filter(|value| value.is_finite());
            let Some(value) = value else {
                let name = quote(names.get(column).unwrap_or_default().as_bytes());
                return wrong(line, quote(field.as_bytes()), format!("a number for {name}"));
            };
            if Some(column) == time {
                times.push(value);
            } else if is_channel(column) {
                samples.push(value);
            }
        }
    }
    let times = time.is_some().then_some(times);
    values::apply(&mut columns, &mut samples, options.values.unwrap_or(Values::Degrees));
    Timed { columns, times, samples }.into_clip(file, options, Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{export, sample};

    #[test]
    fn what_is_written_is_read() {
        let clip = sample::clip();
        let mut out = Vec::new();
        export::csv::write(&mut out, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        let read = parse(&out, "x.csv", &Options::default()).expect("a table");
        assert_eq!(read.clip.motion, clip.motion);
        let names = |clip: &crate::Clip| {
            clip.skeleton.channels.iter().map(|one| one.name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(names(&read.clip), names(&clip));
        assert_eq!(read.notes, Vec::<String>::new());
    }

    #[test]
    fn tables_of_other_programs() {
        let options = Options { fps: Some(25.0), ..Options::default() };
        let read = parse(b"\xef\xbb\xbfframe;head.ry;jaw\r\n0;1;2\r\n1;1.5;-3e1\r\n", "x.csv", &options);
        let clip = read.expect("a table").clip;
        assert_eq!((clip.motion.fps, clip.motion.samples), (25.0, vec![1.0, 2.0, 1.5, -30.0]));
        for (text, message) in [
            ("a,b\n1,2\n", "x.csv: found rows without times, expected a column `time` in seconds, or --rate"),
            ("time,a\n0,1\n1,x\n", "x.csv, line 3: found `x`, expected a number for `a`"),
            ("time,a\n0,1\n1\n", "x.csv, line 3: found 1 fields, expected as many fields as the first row"),
            ("1,2\n3,4\n", "x.csv, line 1: found numbers, expected the names of the columns"),
            ("time,a\n", "x.csv: found no row of values, expected at least one column and one row"),
            ("time\n1\n", "x.csv: found no row of values, expected at least one column and one row"),
        ] {
            let error = parse(text.as_bytes(), "x.csv", &Options::default()).expect_err(text).to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }

    #[test]
    fn units_of_names_and_of_the_caller() {
        let text = b"time,a.goal,b,c_rad,d.rx,e.ty\n0,2048,1,1,1,1\n0.5,2049.5,2,2,2,2\n";
        let names = ["a.goal", "b.rx", "c_rad.rx", "d.rx", "e.ty"];
        let half = 180.0 / std::f64::consts::PI;
        for (values, b, factor, goals) in [
            (None, "b.rx", 1.0, 1),
            (Some(Values::Degrees), "b.rx", 1.0, 1),
            (Some(Values::Radians), "b.rx", half, 1),
            (Some(Values::Goals), "b.goal", 1.0, 2),
        ] {
            let read = parse(text, "x.csv", &Options { values, ..Options::default() }).expect("a table");
            let found = read.clip.skeleton.channels.iter().map(|channel| channel.name.as_str());
            assert!(found.eq(names.map(|name| if name == "b.rx" { b } else { name })));
            assert_eq!(read.clip.motion.frame(1), [2049.5, 2.0 * factor, 2.0 * half, 2.0, 2.0]);
            assert_eq!(read.notes, [format!("{goals} of 5 columns taken as goals of servos")]);
        }
    }
}
