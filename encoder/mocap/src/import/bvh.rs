//! BVH (Biovision hierarchy): a tree of joints, then one line of channel values per frame.
//!
//! Format: "Biovision BVH" (J. Lander, University of Wisconsin, 1999).

use super::error::ImportError;
use super::text::{self, Lexer, quote};
use crate::angles::IDENTITY;
use crate::motion::Motion;
use crate::skeleton::Skeleton;
use crate::skeleton::{Channel, Dof, Joint, Origin};

/// Words of `CHANNELS` lines.
pub(crate) const CHANNEL_NAMES: [(Dof, &str); 6] = [
    (Dof::Tx, "Xposition"),
    (Dof::Ty, "Yposition"),
    (Dof::Tz, "Zposition"),
    (Dof::Rx, "Xrotation"),
    (Dof::Ry, "Yrotation"),
    (Dof::Rz, "Zrotation"),
];

/// Parses a BVH file: `file` is its name for messages and `cm_per_unit` the size of its unit of length.
///
/// Joints and channels are in the file's order. An `End Site` becomes a joint without channels, named after
/// its parent with `.end` behind. A position channel replaces the OFFSET along its axis, at the root and
/// below. `fps` overrides the frame rate, which is else 1 / Frame Time: a whole number where that is what
/// the printed digits mean (`.0083333` is 120). One pass, at more than 50 MB/s.
///
/// # Errors
/// Names the line, what was found there and what was expected. The number of frames must be what the file
/// says.
pub fn parse(
    bytes: &[u8],
    file: &str,
    cm_per_unit: f64,
    fps: Option<f64>,
) -> Result<(Skeleton, Motion), ImportError> {
    text::check(bytes, file, "a BVH file")?;
    let mut lexer = Lexer::new(bytes, file, None, b"{}:");
    let skeleton = Hierarchy::new(cm_per_unit).read(&mut lexer)?;
    let motion = read_motion(&mut lexer, &skeleton, cm_per_unit, fps)?;
    Ok((skeleton, motion))
}

struct Hierarchy {
    cm_per_unit: f64,
    skeleton: Skeleton,
    names: std::collections::HashSet<String>,
    /// Joints whose braces are open, and whether they have an OFFSET yet.
    open: Vec<(usize, bool)>,
}

impl Hierarchy {
    fn new(cm_per_unit: f64) -> Self {
        let origin = Origin::Bvh { cm_per_unit };
        let skeleton = Skeleton { joints: Vec::new(), channels: Vec::new(), origin };
        Self { cm_per_unit, skeleton, names: std::collections::HashSet::new(), open: Vec::new() }
    }

    fn read(mut self, lexer: &mut Lexer) -> Result<Skeleton, ImportError> {
        lexer.expect("HIERARCHY")?;
        lexer.expect("ROOT")?;
        self.begin_joint(lexer, false)?;
        while let Some(&(joint, has_offset)) = self.open.last() {
            if lexer.accept("JOINT") {
                self.begin_joint(lexer, false)?;
            } else if lexer.accept("End") {
                self.begin_joint(lexer, true)?;
            } else if lexer.accept("OFFSET") {
                self.read_offset(lexer, joint)?;
            } else if lexer.accept("CHANNELS") {
                self.read_channels(lexer, joint)?;
            } else if has_offset && lexer.accept("}") {
                self.open.pop();
            } else {
                let next = if has_offset { "`}`" } else { "`OFFSET`" };
                return Err(lexer.error(format!("{next}, `CHANNELS`, `JOINT` or `End Site`")));
            }
        }
        if self.skeleton.channels.is_empty() {
            return Err(lexer.error_found("a hierarchy without channels".into(), "some `CHANNELS`".into()));
        }
        for joint in &mut self.skeleton.joints {
            for channel in joint.channels.clone() {
                let dof = self.skeleton.channels[channel].dof;
                match dof.axis() {
                    Some(axis) if !dof.is_rotation() => joint.offset[axis] = 0.0,
                    _ => joint.rotations.push(channel),
                }
            }
        }
        Ok(self.skeleton)
    }

    fn begin_joint(&mut self, lexer: &mut Lexer, end_site: bool) -> Result<(), ImportError> {
        let parent = self.open.last().map(|&(parent, _)| parent);
        let mut name = lexer.take_name();
        if end_site {
            let above = parent.map_or("", |parent| &self.skeleton.joints[parent].name);
            name = format!("{above}.end");
            while self.names.contains(&name) {
                name.push('\'');
            }
        }
        if name.is_empty() {
            return Err(lexer.error("the joint's name".to_string()));
        }
        if !self.names.insert(name.clone()) {
            return Err(lexer.error_found(
                format!("a second joint {}", quote(name.as_bytes())),
                "names that differ".to_string(),
            ));
        }
        lexer.expect("{")?;
        self.open.push((self.skeleton.joints.len(), false));
        let end = self.skeleton.channels.len();
        self.skeleton.joints.push(Joint {
            name,
            parent,
            offset: [0.0; 3],
            axis: IDENTITY,
            tail: [0.0; 3],
            channels: end..end,
            rotations: Vec::new(),
            level: parent.map_or(1, |parent| self.skeleton.joints[parent].level),
        });
        Ok(())
    }

    fn read_offset(&mut self, lexer: &mut Lexer, joint: usize) -> Result<(), ImportError> {
        for part in &mut self.skeleton.joints[joint].offset {
            *part = self.cm_per_unit * lexer.number(|| "the three numbers of `OFFSET`".to_string())?;
        }
        if let Some((_, has_offset)) = self.open.last_mut() {
            *has_offset = true;
        }
        Ok(())
    }

    fn read_channels(&mut self, lexer: &mut Lexer, joint: usize) -> Result<(), ImportError> {
        let channels = &mut self.skeleton.channels;
        let joints = &mut self.skeleton.joints;
        if !joints[joint].channels.is_empty() || joint + 1 != joints.len() {
            return Err(lexer.error_found(
                "`CHANNELS`".to_string(),
                "it once, and before the joint's children".to_string(),
            ));
        }
        let start = channels.len();
        let count = lexer.number(|| "the number of channels".to_string())?;
        for index in 0..6 {
            if count <= f64::from(index) {
                break;
            }
            lexer.at_line_end();
            let word = lexer.word();
            let mut names = CHANNEL_NAMES.iter();
            let dof = names.find(|(_, name)| word.eq_ignore_ascii_case(name.as_bytes()));
            let dof = dof.filter(|(dof, _)| channels[start..].iter().all(|other| other.dof != *dof));
            let Some(&(dof, _)) = dof else {
                let expected = "such as `Xposition` or `Zrotation`, each once";
                return Err(lexer.error(format!("{count} names {expected}")));
            };
            lexer.take_word();
            let name = format!("{}.{}", joints[joint].name, dof.name());
            channels.push(Channel { name, dof, joint, limits: None });
        }
        if count != (channels.len() - start) as f64 {
            return Err(lexer.error_found(format!("{count} channels"), "a number from 0 to 6".to_string()));
        }
        if let Some(parent) = joints[joint].parent
            && count > 0.0
        {
            joints[joint].level = joints[parent].level.saturating_add(1);
        }
        joints[joint].channels = start..channels.len();
        Ok(())
    }
}

fn read_motion(
    lexer: &mut Lexer,
    skeleton: &Skeleton,
    cm_per_unit: f64,
    fps: Option<f64>,
) -> Result<Motion, ImportError> {
    lexer.expect("MOTION")?;
    lexer.expect("Frames")?;
    lexer.expect(":")?;
    let frames = lexer.number(|| "the number of frames".to_string())?;
    if frames < 1.0 || frames.fract() != 0.0 {
        return Err(lexer.error_found(format!("{frames} frames"), "a whole number from 1 on".to_string()));
    }
    lexer.expect("Frame")?;
    lexer.expect("Time")?;
    lexer.expect(":")?;
    lexer.at_line_end();
    let digits = String::from_utf8_lossy(lexer.word());
    let frame_time = lexer.number(|| "the seconds between two frames".to_string())?;
    let file_fps = rate(frame_time, &digits);
    if !(file_fps.is_finite() && file_fps > 0.0) {
        return Err(lexer.error_found(format!("{frame_time} s between frames"), "more than 0".to_string()));
    }
    let channels = skeleton.channels.len();
    let scales: Vec<f64> = (skeleton.channels.iter())
        .map(|channel| if channel.dof.is_rotation() { 1.0 } else { cm_per_unit })
        .collect();
    let mut samples = Vec::new();
    let mut read = 0_usize;
    while lexer.find_word() {
        read += 1;
        if read as f64 > frames {
            return Err(lexer.error_found(format!("frame {read}"), format!("{frames} frames")));
        }
        for (index, scale) in scales.iter().enumerate() {
            let value = lexer.number(|| format!("number {} of {channels} of frame {read}", index + 1))?;
            samples.push(value * scale);
        }
        if !lexer.at_line_end() {
            return Err(lexer.error(format!("the end of the line after {channels} numbers")));
        }
    }
    if read as f64 != frames {
        return Err(
            lexer.error_found(format!("the end of the file after {read} frames"), format!("{frames}"))
        );
    }
    Ok(Motion { fps: fps.unwrap_or(file_fps), channels, samples })
}

/// Frames per second of a frame time that is printed as `digits`.
///
/// A whole number if that rounds to the digits, of which there must be three for it to mean something.
fn rate(frame_time: f64, digits: &str) -> f64 {
    let mantissa = digits.split(['e', 'E']).next().unwrap_or(digits);
    let significant = mantissa.trim_start_matches(['0', '.', '+']).bytes().filter(u8::is_ascii_digit).count();
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent: i32 = digits.split_once(['e', 'E']).and_then(|(_, text)| text.parse().ok()).unwrap_or(0);
    let half_a_digit = 0.5 * 10_f64.powi(exponent.saturating_sub(decimals as i32));
    let whole = (1.0 / frame_time).round();
    if significant >= 3 && whole >= 1.0 && (1.0 / whole - frame_time).abs() <= half_a_digit * 1.000_001 {
        whole
    } else {
        1.0 / frame_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "HIERARCHY
ROOT Hips of mixamorig:rig {
  OFFSET 1 94 -2
  CHANNELS 4 Zrotation Yposition Xrotation Xposition
\tJOINT arm
\t{
\t\tOFFSET 0.5 -3e1 7
\t\tChannels\t1\tYrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 1 0
\t\t}
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0 2 0
\t\t}
\t}
}
MOTION
Frames: 2
Frame Time: .0083333
10 20 30 40 -50

1 2 3 4 5e-3
";

    fn parse(text: &str) -> Result<(Skeleton, Motion), ImportError> {
        super::parse(text.as_bytes(), "x.bvh", 2.0, None)
    }

    #[test]
    fn any_channels_in_any_order() {
        let (skeleton, motion) = parse(SMALL).expect("a clip");
        assert_eq!(parse(&SMALL.replace('\n', "\r\n")).expect("a clip"), (skeleton.clone(), motion.clone()));
        let names: Vec<&str> = skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(names, ["Hips of mixamorig:rig", "arm", "arm.end", "arm.end'"]);
        let levels: Vec<u8> = skeleton.joints.iter().map(|joint| joint.level).collect();
        assert_eq!(levels, [1, 2, 2, 2]);
        // Positions along x and y replace OFFSET; lengths are in units of 2 cm.
        assert_eq!(skeleton.joints[0].offset, [0.0, 0.0, -4.0]);
        assert_eq!(skeleton.joints[0].rotations, [0, 2]);
        assert_eq!(skeleton.joints[1].offset, [1.0, -60.0, 14.0]);
        assert_eq!(motion.samples, [10.0, 40.0, 30.0, 80.0, -50.0, 1.0, 4.0, 3.0, 8.0, 0.005]);
        assert_eq!(motion.fps, 120.0);
    }

    #[test]
    fn rates_are_what_the_digits_mean() {
        for (digits, fps) in [
            (".0083333", 120.0),
            ("0.00833333", 120.0),
            ("0.010000", 100.0),
            ("0.0333333", 30.0),
            ("4.16667e-2", 24.0),
            (".04", 25.0),
            ("1", 1.0),
            ("0.0334", 1.0 / 0.0334),
            ("0.03", 1.0 / 0.03),
        ] {
            assert_eq!(rate(digits.parse().expect("a number"), digits), fps, "{digits}");
        }
    }

    #[test]
    fn errors_name_line_found_and_expected() {
        for (from, to, message) in [
            (
                "Frames: 2",
                "Frames: 3",
                "x.bvh, line 25: found the end of the file after 2 frames, expected 3",
            ),
            ("Frames: 2", "Frames: 1", "x.bvh, line 24: found frame 2, expected 1 frames"),
            ("Frames: 2", "Frames: -1", "x.bvh, line 20: found -1 frames, expected a whole number from 1 on"),
            ("30 40 -50", "30 40", "line 22: found the end of the line, expected number 5 of 5 of frame 1"),
            ("5e-3", "5e-3 6", "line 24: found `6`, expected the end of the line after 5 numbers"),
            ("CHANNELS 4", "CHANNELS 3", "line 4: found `Xposition`, expected `}`, `CHANNELS`, `JOINT`"),
            ("CHANNELS 4", "CHANNELS 5", "line 4: found the end of the line, expected 5 names such as"),
            ("Xposition", "Yposition", "line 4: found `Yposition`, expected 4 names such as"),
            ("OFFSET 1 94", "OFFSET 1 x", "line 3: found `x`, expected the three numbers of `OFFSET`"),
            ("JOINT arm", "JOINT Hips of mixamorig:rig", "found a second joint `Hips of mixamorig:rig`"),
            ("ROOT", "JOINT", "x.bvh, line 2: found `JOINT`, expected `ROOT`"),
            (".0083333", "0", "x.bvh, line 21: found 0 s between frames, expected more than 0"),
            ("\t\t\tOFFSET 0 1 0\n", "", "line 11: found `}`, expected `OFFSET`, `CHANNELS`, `JOINT`"),
        ] {
            let bad = SMALL.replacen(from, to, 1);
            assert_ne!(bad, SMALL, "{from}");
            let error = parse(&bad).expect_err(to).to_string();
            assert!(error.contains(message), "{to}: {error}");
        }
        let still = "HIERARCHY ROOT a\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 1\nFrame Time: 1\n";
        assert!(parse(still).is_err());
    }

    #[test]
    fn depth_is_not_a_stack() {
        let mut text = "HIERARCHY\nROOT j0\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n".to_string();
        for depth in 1..20_000 {
            text += &format!("JOINT j{depth}\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n");
        }
        let error = parse(&text).expect_err("open braces").to_string();
        assert!(
            error.ends_with("found the end of the file, expected `}`, `CHANNELS`, `JOINT` or `End Site`")
        );
    }
}
