//! BVH (Biovision hierarchy): a tree of joints, then one line of channel values per frame.
//!
//! Format: "Biovision BVH" (J. Lander, University of Wisconsin, 1999).

use std::borrow::Cow;

use super::bones::set_bones;
use super::error::ImportError;
use super::imported::Imported;
use super::names::Names;
use super::rate;
use super::text::{self, Lexer};
use super::unit;
use crate::angles::IDENTITY;
use crate::clip::Clip;
use crate::motion::Motion;
use crate::skeleton::{Channel, Dof, Joint, Origin, Skeleton};

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
/// its parent with `.end` behind. `fps` overrides the frame rate, which is else 1 / Frame Time: a whole number or an NTSC
/// rate where that is what the printed digits mean (`.0083333` is 120, `0.0417083` is 24000/1001). One pass, at more than
/// 50 MB/s, with memory in proportion to the file.
///
/// A position channel replaces the OFFSET along its axis, at the root and below. Below the root, one that stands still in
/// all frames is no channel but the bone: it becomes the joint's offset.
///
/// Some faults are common in files of known programs and are read as other readers do, with a note: a number of frames
/// that is not that of the rows, a name twice, a name that is not UTF-8, a second ROOT (the first is kept), `EndSite`,
/// line ends that are carriage returns alone, a frame time that looks like a rate.
///
/// # Errors
/// Names the line, what was found there and what was expected. A row that has not all its numbers is refused.
pub fn parse(bytes: &[u8], file: &str, cm_per_unit: f64, fps: Option<f64>) -> Result<Imported, ImportError> {
    let (mut imported, _) = read(bytes, file, fps)?;
    unit::scale(&mut imported.clip, cm_per_unit);
    Ok(imported)
}

/// As [`parse`], with lengths in the file's unit. Also the root's OFFSET, of which the skeleton keeps nothing along axes
/// that have a position channel.
pub(super) fn read(bytes: &[u8], file: &str, fps: Option<f64>) -> Result<(Imported, [f64; 3]), ImportError> {
    text::check(bytes, file, "a BVH file")?;
    let mut notes = Vec::new();
    let bytes = if bytes.contains(&b'\r') && !bytes.contains(&b'\n') {
        notes.push("the lines end with a carriage return alone, and are read all the same".to_string());
        Cow::Owned(bytes.iter().map(|&byte| if byte == b'\r' { b'\n' } else { byte }).collect())
    } else {
        Cow::Borrowed(bytes)
    };
    let mut lexer = Lexer::new(&bytes, file, None, b"{}:");
    let Hierarchy { mut skeleton, dropped_channels, root_offset, .. } =
        Hierarchy::new().read(&mut lexer, &mut notes)?;
    let mut motion = read_motion(&mut lexer, &skeleton, dropped_channels, fps, &mut notes)?;
    set_bones(&mut skeleton, &mut motion, &mut notes);
    Ok((Imported { clip: Clip { skeleton, motion }, has_rate: true, notes }, root_offset))
}

struct Hierarchy {
    skeleton: Skeleton,
    names: Names,
    /// Joints whose braces are open.
    open: Vec<Open>,
    /// Channels of further roots, which are in the rows behind those of the skeleton.
    dropped_channels: usize,
    root_offset: [f64; 3],
    /// The first line where `End Site` is one word.
    joined: Option<usize>,
}

/// A joint whose brace is open.
#[derive(Clone, Copy)]
struct Open {
    joint: usize,
    has_offset: bool,
    end_site: bool,
}

impl Hierarchy {
    fn new() -> Self {
        let origin = Origin::Bvh { cm_per_unit: 1.0 };
        let skeleton = Skeleton { joints: Vec::new(), channels: Vec::new(), origin };
        let (names, open) = (Names::default(), Vec::new());
        Self { skeleton, names, open, dropped_channels: 0, root_offset: [0.0; 3], joined: None }
    }

    fn read(mut self, lexer: &mut Lexer, notes: &mut Vec<String>) -> Result<Self, ImportError> {
        lexer.expect("HIERARCHY")?;
        lexer.expect("ROOT")?;
        self.read_tree(lexer)?;
        if let Some(line) = self.joined {
            notes.push(format!("`EndSite` in line {line} is read as `End Site`"));
        }
        self.names.tell(notes);
        let (joints, channels) = (self.skeleton.joints.len(), self.skeleton.channels.len());
        let mut roots = 1;
        while lexer.accept("ROOT") {
            self.read_tree(lexer)?;
            roots += 1;
        }
        if roots > 1 {
            let name = &self.skeleton.joints[0].name;
            let dropped = self.skeleton.joints.len() - joints;
            notes.push(format!(
                "{roots} roots: `{name}` with its {joints} joints is taken, the other {dropped} joints are left out"
            ));
            self.dropped_channels = self.skeleton.channels.len() - channels;
            self.skeleton.joints.truncate(joints);
            self.skeleton.channels.truncate(channels);
        }
        if self.skeleton.channels.is_empty() {
            return Err(lexer.error_found("a hierarchy without channels".into(), "some `CHANNELS`".into()));
        }
        self.root_offset = self.skeleton.joints[0].offset;
        for joint in &mut self.skeleton.joints {
            for channel in joint.channels.clone() {
                let dof = self.skeleton.channels[channel].dof;
                match dof.axis() {
                    Some(axis) if !dof.is_rotation() => joint.offset[axis] = 0.0,
                    _ => joint.rotations.push(channel),
                }
            }
        }
        Ok(self)
    }

    /// Reads a root, whose keyword is read, and all below it.
    fn read_tree(&mut self, lexer: &mut Lexer) -> Result<(), ImportError> {
        self.begin_joint(lexer, false)?;
        while let Some(&Open { joint, has_offset, end_site }) = self.open.last() {
            if !end_site && lexer.accept("JOINT") {
                self.begin_joint(lexer, false)?;
            } else if !end_site && lexer.accept("EndSite") {
                self.joined.get_or_insert(lexer.line());
                self.begin_joint(lexer, true)?;
            } else if !end_site && lexer.accept("End") {
                self.begin_joint(lexer, true)?;
            } else if lexer.accept("OFFSET") {
                self.read_offset(lexer, joint)?;
            } else if lexer.accept("CHANNELS") {
                self.read_channels(lexer, joint)?;
            } else if has_offset && lexer.accept("}") {
                self.open.pop();
            } else {
                let next = if has_offset { "`}`" } else { "`OFFSET`" };
                let expected = match end_site {
                    true => format!("{next}, since an End Site has no children"),
                    false => format!("{next}, `CHANNELS`, `JOINT` or `End Site`"),
                };
                return Err(lexer.error(expected));
            }
        }
        Ok(())
    }

    fn begin_joint(&mut self, lexer: &mut Lexer, end_site: bool) -> Result<(), ImportError> {
        let parent = self.open.last().map(|open| open.joint);
        let found = lexer.take_name();
        if found.is_empty() && !end_site {
            return Err(lexer.error("the joint's name".to_string()));
        }
        let name = match parent {
            Some(parent) if end_site => {
                self.names.unique(&format!("{}.end", self.skeleton.joints[parent].name))
            }
            _ => self.names.take(found, lexer.line()),
        };
        lexer.expect("{")?;
        self.open.push(Open { joint: self.skeleton.joints.len(), has_offset: false, end_site });
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
            *part = lexer.number(|| "the three numbers of `OFFSET`".to_string())?;
        }
        if let Some(open) = self.open.last_mut() {
            open.has_offset = true;
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

/// `dropped` is the number of values in a row behind those of the skeleton's channels.
fn read_motion(
    lexer: &mut Lexer,
    skeleton: &Skeleton,
    dropped: usize,
    fps: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Motion, ImportError> {
    lexer.expect("MOTION")?;
    lexer.expect("Frames")?;
    lexer.expect(":")?;
    let frames = lexer.number(|| "the number of frames".to_string())?;
    lexer.expect("Frame")?;
    lexer.expect("Time")?;
    lexer.expect(":")?;
    lexer.at_line_end();
    let digits = String::from_utf8_lossy(lexer.word());
    let frame_time = lexer.number(|| "the seconds between two frames".to_string())?;
    let file_fps = rate::of_frame_time(frame_time, &digits);
    if fps.is_none() && !(file_fps.is_finite() && file_fps > 0.0) {
        return Err(lexer.error_found(format!("{frame_time} s between frames"), "more than 0".to_string()));
    }
    if fps.is_none() && (10.0..=1000.0).contains(&frame_time) {
        notes.push(format!(
            "the frame time is {frame_time} s, which looks like frames per second: if it is, give --rate {frame_time}"
        ));
    }
    let channels = skeleton.channels.len();
    let numbers = channels + dropped;
    let mut samples = Vec::new();
    let mut read = 0_usize;
    while lexer.find_word() {
        read += 1;
        for index in 0..numbers {
            let value = lexer.number(|| format!("number {} of {numbers} of frame {read}", index + 1))?;
            if index < channels {
                samples.push(value);
            }
        }
        if !lexer.at_line_end() {
            return Err(lexer.error(format!("the end of the line after {numbers} numbers")));
        }
    }
    if read == 0 {
        return Err(lexer.error("a row of numbers for a frame".to_string()));
    }
    if read as f64 != frames {
        notes
            .push(format!("the header says {frames} frames, the file has {read} rows: these are the frames"));
    }
    Ok(Motion { fps: fps.unwrap_or(file_fps), channels, samples })
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

    fn parse(text: &str) -> Result<Clip, ImportError> {
        super::parse(text.as_bytes(), "x.bvh", 2.0, None).map(|read| read.clip)
    }

    #[test]
    fn any_channels_in_any_order() {
        let clip = parse(SMALL).expect("a clip");
        assert_eq!(parse(&SMALL.replace('\n', "\r\n")).expect("a clip"), clip);
        let Clip { skeleton, motion } = clip;
        let names: Vec<&str> = skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(names, ["Hips of mixamorig:rig", "arm", "arm.end", "arm.end_2"]);
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
    fn errors_name_line_found_and_expected() {
        for (from, to, message) in [
            ("Frames: 2", "Frames: x", "x.bvh, line 20: found `x`, expected the number of frames"),
            (
                "\n1 2 3 4 5e-3",
                "\n1 2 3",
                "line 24: found the end of the line, expected number 4 of 5 of frame 2",
            ),
            (
                "10 20 30 40 -50\n\n1 2 3 4 5e-3",
                "",
                "line 23: found the end of the file, expected a row of numbers",
            ),
            ("30 40 -50", "30 40", "line 22: found the end of the line, expected number 5 of 5 of frame 1"),
            ("5e-3", "5e-3 6", "line 24: found `6`, expected the end of the line after 5 numbers"),
            ("CHANNELS 4", "CHANNELS 3", "line 4: found `Xposition`, expected `}`, `CHANNELS`, `JOINT`"),
            ("CHANNELS 4", "CHANNELS 5", "line 4: found the end of the line, expected 5 names such as"),
            ("Xposition", "Yposition", "line 4: found `Yposition`, expected 4 names such as"),
            ("OFFSET 1 94", "OFFSET 1 x", "line 3: found `x`, expected the three numbers of `OFFSET`"),
            (
                "OFFSET 0 2 0",
                "OFFSET 0 2 0 JOINT x",
                "found `JOINT`, expected `}`, since an End Site has no children",
            ),
            ("ROOT", "JOINT", "x.bvh, line 2: found `JOINT`, expected `ROOT`"),
            (".0083333", "0", "x.bvh, line 21: found 0 s between frames, expected more than 0"),
            (
                "\t\t\tOFFSET 0 1 0\n",
                "",
                "line 11: found `}`, expected `OFFSET`, since an End Site has no children",
            ),
        ] {
            let bad = SMALL.replacen(from, to, 1);
            assert_ne!(bad, SMALL, "{from}");
            let error = parse(&bad).expect_err(to).to_string();
            assert!(error.contains(message), "{to}: {error}");
        }
        // Names of joints are in the way of these: End Sites of End Sites are refused before they cost anything.
        let nested = format!(
            "HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n{}",
            "End Site\n{\n".repeat(5000)
        );
        let error = parse(&nested).expect_err("End Sites in End Sites").to_string();
        assert!(error.starts_with("x.bvh, line 8: found `End`, expected `OFFSET`, since"), "{error}");
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

    /// The clip of a changed SMALL, in centimetres, and its notes.
    fn noted(text: impl AsRef<[u8]>) -> (Clip, Vec<String>) {
        let read = super::parse(text.as_ref(), "x.bvh", 1.0, None).unwrap_or_else(|error| panic!("{error}"));
        (read.clip, read.notes)
    }

    #[test]
    fn what_other_readers_take_is_taken_and_told() {
        let (sound, notes) = noted(SMALL);
        assert_eq!(notes, Vec::<String>::new());
        let joined = SMALL.replacen("End Site", "EndSite", 1);
        let padded = SMALL.replace("Frames: 2", "Frames: 0                   ");
        for (text, note) in [
            (SMALL.replace("Frames: 2", "Frames: 3"), "the header says 3 frames, the file has 2 rows"),
            (SMALL.replace("Frames: 2", "Frames: 1"), "the header says 1 frames, the file has 2 rows"),
            (padded, "the header says 0 frames, the file has 2 rows"),
            (joined, "`EndSite` in line 9 is read as `End Site`"),
            (SMALL.replace('\n', "\r"), "the lines end with a carriage return alone"),
        ] {
            let (clip, notes) = noted(&text);
            assert_eq!(clip, sound, "{note}");
            assert!(notes.len() == 1 && notes[0].starts_with(note), "{notes:?}");
        }
        let (clip, notes) = noted(SMALL.replace(".0083333", "30"));
        assert_eq!(clip.motion.fps, 1.0 / 30.0);
        let note = "the frame time is 30 s, which looks like frames per second: if it is, give --rate 30";
        assert_eq!(notes, [note]);
        let given = super::parse(SMALL.replace(".0083333", "30").as_bytes(), "x.bvh", 1.0, Some(30.0));
        let given = given.expect("a clip");
        assert_eq!((given.clip.motion.fps, given.notes.len()), (30.0, 0));
    }

    #[test]
    fn the_first_root_is_taken() {
        let (sound, _) = noted(SMALL);
        let second = "ROOT Hips of mixamorig:rig\n{\nOFFSET 1 2 3\nCHANNELS 2 Xrotation Yrotation\nJOINT arm\n{\nOFFSET \
            0 1 0\nCHANNELS 1 Zrotation\n}\n}\n";
        let text = SMALL.replace("MOTION", &format!("{second}MOTION"));
        let text = text.replace("-50\n", "-50 7 8 9\n").replace("5e-3\n", "5e-3 7 8 9\n");
        let (clip, notes) = noted(&text);
        assert_eq!(clip, sound);
        let note =
            "2 roots: `Hips of mixamorig:rig` with its 4 joints is taken, the other 2 joints are left out";
        assert_eq!(notes, [note]);
    }

    #[test]
    fn names_stay_apart() {
        let names =
            |clip: &Clip| clip.skeleton.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
        let (clip, notes) = noted(SMALL.replace("JOINT arm", "JOINT Hips of mixamorig:rig"));
        assert_eq!(names(&clip)[1], "Hips of mixamorig:rig_2");
        assert_eq!(clip.skeleton.channels[4].name, "Hips of mixamorig:rig_2.ry");
        assert_eq!(notes.len(), 1);
        assert_eq!(
            notes[0],
            "1 joint with a name that came before: `Hips of mixamorig:rig` in line 5 is called `Hips of mixamorig:rig_2`"
        );
        // Two words in Shift-JIS: waist, and bone, whose second byte is a brace.
        let mut bytes = Vec::new();
        for line in SMALL.split_inclusive('\n') {
            match line {
                "ROOT Hips of mixamorig:rig {\n" => bytes.extend_from_slice(b"ROOT \x8d\x98\n{\n"),
                "\tJOINT arm\n" => bytes.extend_from_slice(b"\tJOINT \x83\x7b\x81\x5b\x83\x93\r\n"),
                line => bytes.extend_from_slice(line.as_bytes()),
            }
        }
        let (clip, notes) = noted(&bytes);
        assert_eq!(names(&clip)[..2], ["%8D%98", "%83{%81[%83%93"]);
        assert_eq!(
            notes,
            ["2 joints with a name that is not UTF-8: its other bytes are written as in `%8D%98`"]
        );
    }

    #[test]
    fn positions_that_stand_still_are_bones() {
        let text =
            SMALL.replace("Channels\t1\tYrotation", "Channels 4 Yrotation Xposition Yposition Zposition");
        let text = text.replace("-50\n", "-50 3 -40 0.5\n").replace("5e-3\n", "5e-3 3 -40.001 1\n");
        let (clip, notes) = noted(&text);
        assert_eq!(clip.skeleton.joints[1].offset, [3.0, -40.0, 0.0]);
        let names: Vec<&str> =
            clip.skeleton.channels[4..].iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["arm.ry", "arm.tz"]);
        assert_eq!(clip.motion.frame(1)[4..], [0.005, 1.0]);
        let note =
            "2 of 8 channels are positions that stand still: they are the lengths of bones, and no channels";
        assert_eq!(notes, [note]);
    }
}
