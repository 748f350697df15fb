//! Rows of values with a time each, as tables and recorded moves have them: their skeleton, and frames at a steady rate.

use super::error::ImportError;
use super::imported::Imported;
use super::names::Names;
use super::options::Options;
use super::rate;
use super::values::{self, GOAL};
use crate::angles::IDENTITY;
use crate::clip::Clip;
use crate::motion::Motion;
use crate::skeleton::{Channel, Dof, Joint, Origin, Skeleton};

/// Rows of values, each at its time.
pub(super) struct Timed {
    /// A name for each column: `joint.rx`, or a name alone, which turns about x.
    pub(super) columns: Vec<String>,
    /// In seconds, ascending; none where the rows have no times.
    pub(super) times: Option<Vec<f64>>,
    /// Row-major, in degrees and centimetres.
    pub(super) samples: Vec<f64>,
}

/// Most frames that uneven times become: a day at 100 frames a second.
const MOST_FRAMES: f64 = 8.64e6;

impl Timed {
    /// The clip of these rows. Where their times are uneven, frames are made at the rate in the options, else at the whole
    /// number nearest to the median of the rows' own, and between two rows a value is linear.
    ///
    /// # Errors
    /// No rows, times that do not ascend, rows without times where no rate is given.
    pub(super) fn into_clip(
        self,
        file: &str,
        options: &Options,
        mut notes: Vec<String>,
    ) -> Result<Imported, ImportError> {
        let Self { columns, times, samples } = self;
        let (given, wanted) = (options.fps, options.sampled_fps);
        let wrong = |found: &str, expected: &str| ImportError::File {
            file: file.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        };
        let (skeleton, channels) = (flat_skeleton(&columns, &mut notes), columns.len());
        if channels == 0 || samples.len() < channels {
            return Err(wrong("no row of values", "at least one column and one row"));
        }
        let mut motion = Motion { fps: 1.0, channels, samples };
        motion.unflip(&skeleton);
        let mut imported = |motion: Motion, has_rate: bool| {
            let clip = Clip { skeleton: skeleton.clone(), motion };
            Ok(Imported { clip, has_rate, notes: std::mem::take(&mut notes) })
        };
        if let Some(fps) = given {
            return imported(Motion { fps, ..motion }, true);
        }
        let Some(times) = times else {
            let Some(fps) = wanted else {
                return Err(wrong(
                    "rows without times",
                    "a column `time` in seconds, or --rate for frames a second",
                ));
            };
            return imported(Motion { fps, ..motion }, true);
        };
        if let Some(row) = (1..times.len()).find(|&row| times[row] <= times[row - 1]) {
            let found = format!("time {} of row {} behind {}", times[row], row + 1, times[row - 1]);
            return Err(wrong(&found, "times that ascend"));
        }
        let fps = match rate::of_times(&times) {
            None => return imported(motion, false),
            Some((fps, true)) => return imported(Motion { fps, ..motion }, true),
            Some((fps, false)) => wanted.unwrap_or(fps),
        };
        let span = times[times.len() - 1] - times[0];
        if span * fps > MOST_FRAMES {
            return Err(wrong(&format!("times over {span} seconds"), "times in seconds"));
        }
        let sampled = sample_at(&motion, &times, fps);
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
        let (least, most) = (steps.clone().fold(f64::INFINITY, f64::min), steps.fold(0.0, f64::max));
        let note = format!(
            "the times of the {} rows are uneven ({least:.4} to {most:.4} s apart): sampled at {fps} frames a second",
            times.len()
        );
        let mut read = imported(sampled, true)?;
        read.notes.push(note);
        Ok(read)
    }
}

fn sample_at(motion: &Motion, times: &[f64], fps: f64) -> Motion {
    let last = times.len() - 1;
    let frames = ((times[last] - times[0]) * fps + 1e-6).floor() as usize + 1;
    let mut samples = Vec::with_capacity(frames * motion.channels);
    let mut row = 0;
    for frame in 0..frames {
        let time = times[0] + frame as f64 / fps;
        while row + 1 < last && times[row + 1] <= time {
            row += 1;
        }
        let part = ((time - times[row]) / (times[row + 1] - times[row])).clamp(0.0, 1.0);
        let (from, to) = (motion.frame(row), motion.frame(row + 1));
        samples.extend(from.iter().zip(to).map(|(from, to)| from + part * (to - from)));
    }
    Motion { fps, channels: motion.channels, samples }
}

/// Joints without parents, but for the first, which all hang on: nothing says more. Each has a bone of 10 cm across all
/// three axes, so that an error of a degree is one of 0.14 cm.
fn flat_skeleton(columns: &[String], notes: &mut Vec<String>) -> Skeleton {
    // A number of goals that jumps is no turn.
    let split = |column: &str| match values::split(column) {
        Some((joint, word)) if word.eq_ignore_ascii_case(GOAL) => (joint.to_string(), Dof::Tx, GOAL),
        Some((joint, word)) => {
            let dof = Dof::ALL.into_iter().find(|dof| word.eq_ignore_ascii_case(dof.name()));
            let dof = dof.unwrap_or(Dof::Rx);
            (joint.to_string(), dof, dof.name())
        }
        None => (column.to_string(), Dof::Rx, Dof::Rx.name()),
    };
    let bone = 10.0 / 3_f64.sqrt();
    let mut names = Names::default();
    let (mut joints, mut channels): (Vec<Joint>, Vec<Channel>) = (Vec::new(), Vec::new());
    let mut given = String::new();
    for (index, column) in columns.iter().enumerate() {
        let (found, dof, word) = split(column);
        let again = channels
            .iter()
            .rev()
            .take_while(|channel| channel.joint + 1 == joints.len())
            .any(|other| other.dof == dof);
        if joints.is_empty() || found != given || again {
            joints.push(Joint {
                name: names.take(found.as_bytes(), 1),
                parent: (!joints.is_empty()).then_some(0),
                offset: [0.0; 3],
                axis: IDENTITY,
                tail: [bone; 3],
                channels: index..index,
                rotations: Vec::new(),
                level: if joints.is_empty() { 1 } else { 2 },
            });
            given = found;
        }
        let joint = joints.len() - 1;
        joints[joint].channels.end = index + 1;
        if dof.is_rotation() {
            joints[joint].rotations.push(index);
        }
        channels.push(Channel { name: format!("{}.{word}", joints[joint].name), dof, joint, limits: None });
    }
    names.tell(notes);
    let goals = channels.iter().filter(|channel| channel.name.ends_with(&format!(".{GOAL}"))).count();
    if goals > 0 {
        notes.push(format!("{goals} of {} columns taken as goals of servos", channels.len()));
    }
    Skeleton { joints, channels, origin: Origin::Table }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timed(times: &[f64]) -> Timed {
        let columns = ["head.ry", "head.rx", "jaw"].map(String::from).to_vec();
        let samples = times.iter().flat_map(|time| [100.0 * time, 5.0, -time]).collect();
        Timed { columns, times: Some(times.to_vec()), samples }
    }

    #[test]
    fn steady_times_are_a_rate() {
        let times: Vec<f64> =
            (0..50).map(|row| 7.0 + (f64::from(row) / 29.97 * 1000.0).round() / 1000.0).collect();
        let read = timed(&times).into_clip("x.csv", &Options::default(), Vec::new()).expect("a clip");
        assert_eq!((read.clip.motion.fps, read.clip.motion.frames()), (30_000.0 / 1001.0, 50));
        assert_eq!(read.notes, Vec::<String>::new());
        let names: Vec<&str> =
            read.clip.skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["head.ry", "head.rx", "jaw.rx"]);
        assert_eq!(read.clip.skeleton.joints.len(), 2);
    }

    #[test]
    fn uneven_times_are_sampled_and_told() {
        let read = timed(&[0.0, 0.02, 0.03, 0.05, 0.07, 0.1])
            .into_clip("x.csv", &Options::default(), Vec::new())
            .expect("a clip");
        assert_eq!((read.clip.motion.fps, read.clip.motion.frames()), (50.0, 6));
        for (frame, row) in read.clip.motion.iter().enumerate() {
            assert!((row[0] - 2.0 * frame as f64).abs() < 1e-9, "{row:?}");
        }
        let note =
            "the times of the 6 rows are uneven (0.0100 to 0.0300 s apart): sampled at 50 frames a second";
        assert_eq!(read.notes, [note]);
        let options = Options { sampled_fps: Some(25.0), ..Options::default() };
        let wanted = timed(&[0.0, 0.02, 0.03, 0.1]).into_clip("x.csv", &options, Vec::new()).expect("a clip");
        assert_eq!((wanted.clip.motion.fps, wanted.clip.motion.frames()), (25.0, 3));
    }

    #[test]
    fn times_that_do_not_ascend_are_refused() {
        let error = timed(&[0.0, 0.2, 0.1])
            .into_clip("x.csv", &Options::default(), Vec::new())
            .expect_err("a time back");
        assert_eq!(
            error.to_string(),
            "x.csv: found time 0.1 of row 3 behind 0.2, expected times that ascend"
        );
    }
}
