//! Which frames of a motion.

use anyhow::{Result, bail};
use mocap::Motion;
use std::path::Path;
use std::str::FromStr;

/// Frames from one to another, as `FIRST..END`: either may be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    first: usize,
    end: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("found {text:?}, expected frames like 1.., ..300 or 1..300");
        let (first, end) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str, if_empty| match text {
            "" => Ok(if_empty),
            text => text.parse().map(Some).map_err(|_| wrong()),
        };
        let range = Self { first: number(first, Some(0))?.unwrap_or(0), end: number(end, None)? };
        if range.end.is_some_and(|end| end <= range.first) {
            return Err(format!("found {text:?}, expected a frame between the two numbers"));
        }
        Ok(range)
    }
}

impl FrameRange {
    /// These frames of the motion in the file `path`.
    ///
    /// # Errors
    /// A sentence where it has not so many.
    pub fn of(self, path: &Path, motion: &Motion) -> Result<Motion> {
        let frames = motion.frames();
        let end = self.end.unwrap_or(frames);
        if self.first >= end || end > frames {
            let Self { first, .. } = self;
            bail!("{} has {frames} frames, expected more than {}", path.display(), first.max(end - 1));
        }
        let samples = motion.samples[self.first * motion.channels..end * motion.channels].to_vec();
        Ok(Motion { samples, ..motion.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(text: &str) -> Result<Vec<f64>, String> {
        let motion = Motion { fps: 30.0, channels: 2, samples: (0..10).map(f64::from).collect() };
        let range: FrameRange = text.parse()?;
        range.of(Path::new("a.bvh"), &motion).map(|cut| cut.samples).map_err(|error| error.to_string())
    }

    #[test]
    fn frames_are_counted_from_0_and_the_end_is_left_out() {
        assert_eq!(cut("1..").unwrap(), [2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        assert_eq!(cut("..2").unwrap(), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(cut("3..4").unwrap(), [6.0, 7.0]);
        assert_eq!(cut("..").unwrap().len(), 10);
        assert_eq!(cut("0..5").unwrap().len(), 10);
    }

    #[test]
    fn other_ranges_are_refused() {
        for text in ["", "3", "a..", "..-1", "1...3", "2..2", "3..1"] {
            assert!(cut(text).unwrap_err().starts_with(&format!("found {text:?}, expected")), "{text}");
        }
        assert_eq!(cut("5..").unwrap_err(), "a.bvh has 5 frames, expected more than 5");
        assert_eq!(cut("..6").unwrap_err(), "a.bvh has 5 frames, expected more than 5");
        assert_eq!(cut("7..9").unwrap_err(), "a.bvh has 5 frames, expected more than 8");
    }
}
