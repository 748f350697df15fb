//! AMC (Acclaim motion): one block of lines per frame, one line per bone.
//!
//! Format: "Acclaim ASF/AMC" (M. Schafer, 1994; J. Lander, University of Wisconsin, 1999).

use std::collections::HashMap;

use super::error::ImportError;
use super::text::{self, Lexer, quote};
use crate::motion::Motion;
use crate::skeleton::Skeleton;
use crate::skeleton::{Dof, Origin};

/// Frames per second of a file that does not say: the rate of the CMU database.
pub const DEFAULT_FPS: f64 = 120.0;

/// Parses an AMC file: `file` is its name for messages.
///
/// Bones may come in any order, but each of the skeleton's bones with channels once a frame; frame numbers
/// go up by one. `:DEGREES`, `:RADIANS` and `:SAMPLES-PER-SECOND` in the file overrule the skeleton's unit of
/// angle and [`DEFAULT_FPS`]; `fps` overrules all. One pass, at more than 50 MB/s.
///
/// # Errors
/// Names the line, what was found there and what was expected.
pub fn parse(bytes: &[u8], file: &str, skeleton: &Skeleton, fps: Option<f64>) -> Result<Motion, ImportError> {
    read(bytes, file, skeleton, fps).map(|(motion, _)| motion)
}

/// As [`parse`]; also whether the file names a rate.
pub(super) fn read(
    bytes: &[u8],
    file: &str,
    skeleton: &Skeleton,
    fps: Option<f64>,
) -> Result<(Motion, bool), ImportError> {
    text::check(bytes, file, "an AMC file")?;
    let Origin::Asf { cm_per_unit, radians } = skeleton.origin else {
        return Err(ImportError::File {
            file: file.to_string(),
            found: "another kind of skeleton for it".to_string(),
            expected: "its ASF file".to_string(),
        });
    };
    let mut lexer = Lexer::new(bytes, file, Some(b'#'), b"");
    let header = Header::read(&mut lexer, radians)?;
    let scales: Vec<f64> = (skeleton.channels.iter())
        .map(|channel| match channel.dof {
            Dof::Rx | Dof::Ry | Dof::Rz => header.degrees_per_unit,
            _ => cm_per_unit,
        })
        .collect();
    let mut frames = Frames::new(skeleton, &scales);
    let mut number = None;
    while lexer.find_word() {
        number = Some(frame_number(&mut lexer, number)?);
        frames.read_frame(&mut lexer)?;
    }
    if frames.samples.is_empty() {
        return Err(lexer.error("a frame".to_string()));
    }
    let motion = Motion {
        fps: fps.or(header.fps).unwrap_or(DEFAULT_FPS),
        channels: skeleton.channels.len(),
        samples: frames.samples,
    };
    Ok((motion, header.fps.is_some()))
}

struct Header {
    degrees_per_unit: f64,
    fps: Option<f64>,
}

impl Header {
    fn read(lexer: &mut Lexer, radians: bool) -> Result<Self, ImportError> {
        let unit = |radians| if radians { 1_f64.to_degrees() } else { 1.0 };
        let mut header = Self { degrees_per_unit: unit(radians), fps: None };
        while lexer.find_word() && lexer.word().starts_with(b":") {
            let keyword = lexer.take_word();
            if keyword.eq_ignore_ascii_case(b":DEGREES") {
                header.degrees_per_unit = unit(false);
            } else if keyword.eq_ignore_ascii_case(b":RADIANS") {
                header.degrees_per_unit = unit(true);
            } else if keyword.eq_ignore_ascii_case(b":SAMPLES-PER-SECOND") {
                let fps = lexer.number(|| "frames per second".to_string())?;
                if fps <= 0.0 {
                    return Err(lexer.error_found(
                        format!("a frame rate of {fps}"),
                        "more than 0 frames per second".to_string(),
                    ));
                }
                header.fps = Some(fps);
            }
            while !lexer.at_line_end() {
                lexer.take_word();
            }
        }
        Ok(header)
    }
}

/// Reads a frame's number, which is one above the previous frame's.
fn frame_number(lexer: &mut Lexer, previous: Option<u64>) -> Result<u64, ImportError> {
    let expected = || match previous {
        None => "the number of the first frame".to_string(),
        Some(previous) => format!("frame number {}", u128::from(previous) + 1),
    };
    let number = integer(lexer.word()).ok_or_else(|| lexer.error(expected()))?;
    if previous.is_some_and(|previous| previous.checked_add(1) != Some(number)) {
        return Err(lexer.error(expected()));
    }
    lexer.take_word();
    end_line(lexer)?;
    Ok(number)
}

fn integer(word: &[u8]) -> Option<u64> {
    if !word.iter().all(u8::is_ascii_digit) {
        return None;
    }
    str::from_utf8(word).ok()?.parse().ok()
}

fn end_line(lexer: &mut Lexer) -> Result<(), ImportError> {
    if lexer.at_line_end() { Ok(()) } else { Err(lexer.error("the end of the line".to_string())) }
}

struct Frames<'a> {
    skeleton: &'a Skeleton,
    scales: &'a [f64],
    joints: HashMap<&'a [u8], usize>,
    /// Joints in the order of the previous frame, which the next frame most likely has too.
    order: Vec<usize>,
    /// Per joint: the last frame that named it, from 1.
    seen: Vec<usize>,
    /// Number of joints that a frame must name: those with channels.
    needed: usize,
    count: usize,
    samples: Vec<f64>,
}

impl<'a> Frames<'a> {
    fn new(skeleton: &'a Skeleton, scales: &'a [f64]) -> Self {
        let joints = skeleton.joints.iter().enumerate().map(|(index, joint)| (joint.name.as_bytes(), index));
        Self {
            skeleton,
            scales,
            joints: joints.collect(),
            order: Vec::new(),
            seen: vec![0; skeleton.joints.len()],
            needed: skeleton.joints.iter().filter(|joint| !joint.channels.is_empty()).count(),
            count: 0,
            samples: Vec::new(),
        }
    }

    fn read_frame(&mut self, lexer: &mut Lexer) -> Result<(), ImportError> {
        self.count += 1;
        let start = self.samples.len();
        self.samples.resize(start + self.skeleton.channels.len(), 0.0);
        let mut named = 0;
        let mut position = 0;
        while lexer.find_word() && integer(lexer.word()).is_none() {
            let joint = self.find_joint(lexer, position)?;
            if self.seen[joint] == self.count {
                return Err(lexer.error_found(
                    format!("bone {} for the second time", quote(lexer.word())),
                    format!("each bone once in frame {}", self.count),
                ));
            }
            self.seen[joint] = self.count;
            match self.order.get_mut(position) {
                Some(expected) => *expected = joint,
                None => self.order.push(joint),
            }
            position += 1;
            lexer.take_word();
            let joint = &self.skeleton.joints[joint];
            for channel in joint.channels.clone() {
                let value = lexer.number(|| {
                    format!(
                        "a number for `{}` ({} numbers)",
                        self.skeleton.channels[channel].name,
                        joint.channels.len()
                    )
                })?;
                self.samples[start + channel] = self.scaled(lexer, value, channel)?;
            }
            end_line(lexer)?;
            named += usize::from(!joint.channels.is_empty());
        }
        if named == self.needed { Ok(()) } else { Err(self.missing(lexer)) }
    }

    fn find_joint(&self, lexer: &Lexer, position: usize) -> Result<usize, ImportError> {
        let name = lexer.word();
        if let Some(&joint) = self.order.get(position)
            && self.skeleton.joints[joint].name.as_bytes() == name
        {
            return Ok(joint);
        }
        self.joints.get(name).copied().ok_or_else(|| lexer.error("a bone of the skeleton".to_string()))
    }

    fn scaled(&self, lexer: &Lexer, value: f64, channel: usize) -> Result<f64, ImportError> {
        let scaled = value * self.scales[channel];
        if scaled.is_finite() {
            return Ok(scaled);
        }
        Err(lexer.error_found(format!("{value:e}"), "a number that a scale does not overflow".to_string()))
    }

    fn missing(&self, lexer: &Lexer) -> ImportError {
        let joints = self.skeleton.joints.iter().zip(&self.seen);
        let missing = joints
            .filter(|(joint, seen)| !joint.channels.is_empty() && **seen != self.count)
            .map(|(joint, _)| joint.name.as_str())
            .next()
            .unwrap_or_default();
        lexer.error_found(format!("the end of frame {}", self.count), format!("bone `{missing}` in it"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::asf::tests::odd_skeleton;

    const FRAMES: &str = "# a comment
:FULLY-SPECIFIED
:SAMPLES-PER-SECOND 50 # a rate
7 # the first frame
base 0.5
tip 1 0.25 2 -.5
root 0.1 2 0.2 1 0.3 3.64024e-015
8
root -0.1 2 0.2 1 0.3 0
base 0
tip 0 0 0 1e-1
";

    fn parse(text: &str) -> Result<Motion, ImportError> {
        super::parse(text.as_bytes(), "x.amc", &odd_skeleton(), None)
    }

    #[test]
    fn bones_in_any_order_with_the_units_of_the_skeleton() {
        let motion = parse(FRAMES).expect("two frames");
        assert_eq!(motion, parse(&FRAMES.replace('\n', "\r\n")).expect("two frames"));
        assert_eq!((motion.fps, motion.channels, motion.frames()), (50.0, 11, 2));
        let (degree, cm) = (1_f64.to_degrees(), 2.54 / 0.45);
        let root = [0.1 * degree, 2.0 * cm, 0.2 * degree, cm, 0.3 * degree, 3.64024e-15 * cm];
        assert_eq!(motion.frame(0)[..6], root);
        assert_eq!(motion.frame(0)[6..], [cm, 0.25 * degree, 2.0 * cm, -0.5 * degree, 0.5 * cm]);
        assert_eq!(motion.frame(1)[9], 0.1 * degree);
    }

    #[test]
    fn header_and_caller_overrule_unit_and_rate() {
        let degrees = FRAMES.replace(":FULLY-SPECIFIED", ":FULLY-SPECIFIED\n:degrees");
        assert_eq!(parse(&degrees).expect("two frames").frame(0)[0], 0.1);
        let motion = super::parse(FRAMES.as_bytes(), "x.amc", &odd_skeleton(), Some(24.0));
        assert_eq!(motion.expect("two frames").fps, 24.0);
        let silent = FRAMES.replace(":SAMPLES-PER-SECOND", ":SOMETHING-ELSE");
        assert_eq!(parse(&silent).expect("two frames").fps, DEFAULT_FPS);
    }

    #[test]
    fn errors_name_line_found_and_expected() {
        for (from, to, message) in [
            ("base 0.5\n", "", "x.amc, line 7: found the end of frame 1, expected bone `base` in it"),
            (
                "base 0\n",
                "base 0\nbase 0\n",
                "x.amc, line 11: found bone `base` for the second time, expected",
            ),
            ("tip 1 0.25", "tap 1 0.25", "x.amc, line 6: found `tap`, expected a bone of the skeleton"),
            ("2 -.5", "2", "line 6: found the end of the line, expected a number for `tip.ry` (4 numbers)"),
            ("2 -.5", "2 -.5 8", "line 6: found `8`, expected the end of the line"),
            ("\n8\n", "\n9\n", "x.amc, line 8: found `9`, expected frame number 8"),
            ("0.25", "nan", "x.amc, line 6: found `nan`, expected a number for `tip.rx`"),
            ("0.25", "1e308", "x.amc, line 6: found 1e308, expected a number that a scale does not overflow"),
            (
                "7 # the first frame",
                "",
                "x.amc, line 5: found `base`, expected the number of the first frame",
            ),
            ("50", "0", "x.amc, line 3: found a frame rate of 0, expected more than 0 frames per second"),
        ] {
            let bad = FRAMES.replacen(from, to, 1);
            assert_ne!(bad, FRAMES, "{from}");
            let error = parse(&bad).expect_err(to).to_string();
            assert!(error.contains(message), "{to}: {error}");
        }
        let error = parse(":FULLY-SPECIFIED\n").expect_err("no frame").to_string();
        assert_eq!(error, "x.amc, line 2: found the end of the file, expected a frame");
    }
}
