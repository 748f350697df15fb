//! The puppet: which servo follows which channel of a skeleton, as a person writes it in `puppet.toml`.
//!
//! ```toml
//! skeleton = "02.asf"       # optional: where channel names are looked up, relative to this file
//! servo_hz = 50             # goals per second, 1 to 1000
//! baud = 1_000_000          # of the servo bus
//!
//! [[joint]]
//! name = "right elbow"
//! channel = "rradius.rx"    # joint.axis of the skeleton
//! id = 3                    # of the servo, 0 to 252
//! zero = 1024               # goal at channel value 0, and where the servo starts; 2048 unless given
//! direction = -1            # 1 (unless given) or -1
//! scale = 11.378            # goal units per degree or cm; 4096 a turn unless given (rotations only)
//! range = [0, 150]          # lowest and highest channel value, in degrees or cm
//! max_speed = 270           # degrees or cm per second
//! ```
//!
//! Instead of `range`, `goal_range = [min, max]` gives the range in goal units. Goals are those of a servo in
//! position mode, 0 to 4095.

use crate::files;
use anyhow::{Context, Result, anyhow, bail};
use decoder_core::I16F16;
use encoder::skeleton::{ChannelKind, Skeleton};
use firmware::dynamixel::table::POSITIONS_PER_TURN;
use firmware::map::{Joint, JointMap, MAX_SERVOS, bytes_len};
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// The servos of this project's puppets, as the device gets them.
pub type Map = JointMap<MAX_SERVOS>;

/// A map as the bytes that a device parses.
///
/// # Errors
/// None that a map of [`MAX_SERVOS`] can have.
pub fn to_bytes(map: &Map) -> Result<Vec<u8>> {
    let mut buffer = [0; bytes_len(MAX_SERVOS)];
    Ok(map.to_bytes(&mut buffer)?.to_vec())
}

/// A puppet.toml whose keys and value types are right; [`Puppet::map`] checks what they say.
#[derive(Debug)]
pub struct Puppet {
    path: PathBuf,
    text: String,
    file: File,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    skeleton: Option<PathBuf>,
    servo_hz: Spanned<u16>,
    baud: Spanned<u32>,
    joint: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Spanned<String>,
    channel: Spanned<String>,
    id: Spanned<u8>,
    zero: Option<Spanned<i32>>,
    direction: Option<Spanned<i8>>,
    scale: Option<Spanned<f64>>,
    range: Option<Spanned<[f64; 2]>>,
    goal_range: Option<Spanned<[i32; 2]>>,
    max_speed: Spanned<f64>,
}

impl Puppet {
    /// Reads a puppet.toml.
    ///
    /// # Errors
    /// A sentence that names the file, the line and the key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = String::from_utf8(files::read(path)?).map_err(|error| {
            anyhow!("{}: byte {}: not text", path.display(), error.utf8_error().valid_up_to())
        })?;
        Self::parse(path, text)
    }

    /// As [`read`](Self::read), of a text that came from `path`.
    ///
    /// # Errors
    /// A sentence that names the file, the line and the key.
    pub fn parse(path: &Path, text: String) -> Result<Self> {
        match toml::from_str(&text) {
            Ok(file) => Ok(Self { path: path.to_owned(), text, file }),
            Err(error) => {
                let place = error.span().map_or(String::new(), |span| place(&text, span));
                bail!("{}{place}: {}", path.display(), error.message().replace('\n', ", "))
            }
        }
    }

    /// Where the puppet says that its skeleton is.
    pub fn skeleton(&self) -> Option<PathBuf> {
        let skeleton = self.file.skeleton.as_ref()?;
        Some(self.path.parent().map_or_else(|| skeleton.clone(), |folder| folder.join(skeleton)))
    }

    /// The joint map: names resolved in `skeleton`, units converted.
    ///
    /// # Errors
    /// A sentence that names the file, the line, the key, what was found, and what was expected.
    pub fn map(&self, skeleton: &Skeleton) -> Result<Map> {
        let mut joints = heapless::Vec::new();
        for (index, entry) in self.file.joint.iter().enumerate() {
            let earlier = self.file.joint.iter().take(index);
            if earlier.clone().any(|other| other.name.get_ref() == entry.name.get_ref()) {
                return Err(self.wrong(&entry.name, "another joint has this name"));
            }
            if let Some(other) = earlier.clone().find(|other| other.id.get_ref() == entry.id.get_ref()) {
                let why = format!("joint \"{}\" has id {} as well", other.name.get_ref(), other.id.get_ref());
                return Err(self.wrong(&entry.id, &why));
            }
            joints.push(self.joint(entry, skeleton)?).map_err(|_| {
                anyhow!("{}: more than {MAX_SERVOS} joints, the most that a board holds", self.path.display())
            })?;
        }
        JointMap::new(*self.file.servo_hz.get_ref(), *self.file.baud.get_ref(), joints)
            .with_context(|| self.path.display().to_string())
    }

    /// [`map`](Self::map) as the bytes that a device parses.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn map_bytes(&self, skeleton: &Skeleton) -> Result<Vec<u8>> {
        to_bytes(&self.map(skeleton)?)
    }

    fn joint(&self, entry: &Entry, skeleton: &Skeleton) -> Result<Joint> {
        let name = entry.channel.get_ref();
        let Some(channel) = skeleton.channel(name) else {
            return Err(self.wrong(&entry.channel, &no_channel(name, skeleton)));
        };
        let turns =
            matches!(skeleton.channels[channel].kind, ChannelKind::Rx | ChannelKind::Ry | ChannelKind::Rz);
        let unit = if turns { "degree" } else { "cm" };
        let scale = match &entry.scale {
            Some(scale) => self.positive(scale, I16F16::MAX.to_num())?,
            None if turns => f64::from(POSITIONS_PER_TURN) / 360.0,
            None => {
                return Err(self.wrong(&entry.channel, "a translation needs `scale`, in goal units per cm"));
            }
        };
        let sign = match &entry.direction {
            None => 1.0,
            Some(direction) => match *direction.get_ref() {
                sign @ (1 | -1) => f64::from(sign),
                found => return Err(self.wrong(direction, &format!("found {found}, expected 1 or -1"))),
            },
        };
        let middle = POSITIONS_PER_TURN / 2;
        let zero = entry.zero.as_ref().map_or(middle, |zero| *zero.get_ref());
        let to_goal = |value: f64| (f64::from(zero) + sign * scale * value).round();
        let ([one, other], place) = match (&entry.range, &entry.goal_range) {
            (Some(range), None) => (range.get_ref().map(to_goal), range.span()),
            (None, Some(range)) => (range.get_ref().map(f64::from), range.span()),
            _ => {
                return Err(self.wrong(&entry.name, "expected either `range` or `goal_range`, and not both"));
            }
        };
        let (min, max) = (one.min(other), one.max(other));
        let highest = POSITIONS_PER_TURN - 1;
        if !(min >= 0.0 && max <= f64::from(highest)) {
            let why = format!("these are goals {min} to {max}, a servo takes 0 to {highest}");
            return Err(self.wrong_at(place, &why));
        }
        if f64::from(zero) < min || f64::from(zero) > max {
            let why = format!("these are goals {min} to {max}, which must include the zero, {zero}");
            return Err(self.wrong_at(place, &why));
        }
        let hz = f64::from(*self.file.servo_hz.get_ref());
        let step = self.positive(&entry.max_speed, f64::MAX)? * scale / hz;
        if step < 1.0 {
            let why =
                format!("less than one goal unit in 1/{hz} s, expected at least {:.2} {unit}s/s", hz / scale);
            return Err(self.wrong(&entry.max_speed, &why));
        }
        let channel = u16::try_from(channel)
            .map_err(|_| self.wrong(&entry.channel, "a clip has at most 65535 channels"))?;
        let scale = I16F16::saturating_from_num(sign * scale);
        if scale == I16F16::ZERO {
            return Err(self.wrong(&entry.name, "the scale is too small for a servo to move"));
        }
        let max_step = step.min(f64::from(POSITIONS_PER_TURN)) as i32;
        Ok(Joint {
            channel,
            id: *entry.id.get_ref(),
            zero,
            scale,
            min: min as i32,
            max: max as i32,
            max_step,
        })
    }

    fn positive(&self, value: &Spanned<f64>, highest: f64) -> Result<f64> {
        let found = *value.get_ref();
        if found > 0.0 && found <= highest {
            return Ok(found);
        }
        Err(self.wrong(value, &format!("found {found}, expected more than 0 and at most {highest}")))
    }

    fn wrong<T>(&self, value: &Spanned<T>, why: &str) -> anyhow::Error {
        self.wrong_at(value.span(), why)
    }

    fn wrong_at(&self, span: Range<usize>, why: &str) -> anyhow::Error {
        anyhow!("{}{}: {why}", self.path.display(), place(&self.text, span))
    }
}

/// `, line 12, key "id"`: where a byte range of the file is.
fn place(text: &str, span: Range<usize>) -> String {
    let before = text.get(..span.start).unwrap_or(text);
    let number = before.matches('\n').count() + 1;
    let line = text.lines().nth(number - 1).unwrap_or_default();
    match line.split_once('=') {
        Some((key, _)) => format!(", line {number}, key \"{}\"", key.trim()),
        None => format!(", line {number}"),
    }
}

/// Says that a skeleton lacks a channel, and which it may have meant.
pub(crate) fn no_channel(name: &str, skeleton: &Skeleton) -> String {
    let joint_name = name.split('.').next().unwrap_or(name);
    if let Some(joint) = skeleton.joints.iter().find(|joint| joint.name == joint_name) {
        let channels: Vec<_> = skeleton.channels[joint.channels.clone()].iter().map(|c| &*c.name).collect();
        return match channels.is_empty() {
            true => format!("\"{name}\" is no channel: the skeleton's joint \"{joint_name}\" does not move"),
            false => {
                format!("\"{name}\" is no channel of the skeleton; its joint has {}", channels.join(", "))
            }
        };
    }
    let mut near: Vec<_> = skeleton
        .channels
        .iter()
        .map(|channel| (strsim::levenshtein(name, &channel.name), &channel.name))
        .collect();
    near.sort();
    let near: Vec<_> = near.iter().take(3).map(|(_, name)| name.as_str()).collect();
    format!("the skeleton has no joint \"{joint_name}\"; the nearest channels are {}", near.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// One joint, with these lines in it, on the embedded sample's skeleton.
    fn map(lines: &str) -> Result<Map> {
        let text = format!("servo_hz = 50\nbaud = 1_000_000\n[[joint]]\n{lines}\n");
        Puppet::parse(Path::new("puppet.toml"), text)?.map(&encoder::sample::clip().skeleton)
    }

    const ELBOW: &str = "name = 'elbow'\nchannel = 'rradius.rx'\nid = 3\nrange = [-90, 10]\nmax_speed = 90";

    fn error(from: &str, to: &str) -> String {
        assert!(ELBOW.contains(from));
        format!("{:#}", map(&ELBOW.replace(from, to)).unwrap_err())
    }

    #[test]
    fn units_are_converted() {
        let skeleton = encoder::sample::clip().skeleton;
        let joint = map(ELBOW).unwrap().joints()[0];
        assert_eq!(skeleton.channels[usize::from(joint.channel)].name, "rradius.rx");
        // 90° are a quarter of 4096, 10° are 113.8; 90°/s at 50 Hz are 20.48 a tick, rounded down.
        assert_eq!((joint.id, joint.zero, joint.min, joint.max, joint.max_step), (3, 2048, 1024, 2162, 20));
        assert!((joint.scale.to_num::<f64>() - 4096.0 / 360.0).abs() < 1e-5);
        assert_eq!(joint.goal(I16F16::from_num(-45)), 1536);

        let turned = map(&format!("{ELBOW}\ndirection = -1\nzero = 1000")).unwrap().joints()[0];
        assert_eq!((turned.min, turned.max), (886, 2024));
        assert_eq!(turned.goal(I16F16::from_num(-45)), 1512);

        let goals = map(&ELBOW.replace("range = [-90, 10]", "goal_range = [2100, 2000]\nscale = 2.5"));
        let joint = goals.unwrap().joints()[0];
        assert_eq!((joint.min, joint.max, joint.scale), (2000, 2100, I16F16::lit("2.5")));
        assert_eq!(joint.max_step, 4);

        let slide = ELBOW.replace("rradius.rx", "root.ty").replace("[-90, 10]", "[-2, 2]\nscale = 100");
        assert_eq!(map(&slide).unwrap().joints()[0].min, 1848);
    }

    #[test]
    fn a_wrong_channel_names_near_ones() {
        let unknown = error("rradius.rx", "rradus.rx");
        assert!(unknown.starts_with("puppet.toml, line 5, key \"channel\": "), "{unknown}");
        assert!(unknown.contains("no joint \"rradus\"") && unknown.contains("rradius.rx"), "{unknown}");
        let axis = error("rradius.rx", "rradius.rz");
        assert!(axis.contains("its joint has rradius.rx"), "{axis}");
        let still = error("rradius.rx", "rclavicle.rx");
        assert!(still.contains("does not move"), "{still}");
        assert_eq!(unknown.lines().count(), 1);
    }

    #[test]
    fn a_wrong_value_names_its_line_and_key() {
        let cases = [
            ("id = 3", "id = 300", "line 6, key \"id\": invalid value: integer `300`"),
            ("id = 3", "id = 253", "servo id 253 is out of range"),
            ("id = 3", "idd = 3", "line 6, key \"idd\": unknown field `idd`"),
            ("id = 3", "id = ", "line 6, key \"id\""),
            ("range = [-90, 10]", "range = [10, 90]", "line 7, key \"range\": these are goals 2162 to 3072"),
            ("range = [-90, 10]", "range = [-200, 10]", "a servo takes 0 to 4095"),
            ("range = [-90, 10]", "range = [-90, nan]", "line 7, key \"range\""),
            ("range = [-90, 10]", "", "either `range` or `goal_range`"),
            ("max_speed = 90", "max_speed = 4", "line 8, key \"max_speed\": less than one goal unit"),
            ("max_speed = 90", "max_speed = -1", "found -1, expected more than 0"),
            ("max_speed = 90", "max_speed = 90\ndirection = 2", "found 2, expected 1 or -1"),
            ("max_speed = 90", "max_speed = 90\nscale = 0", "line 9, key \"scale\": found 0"),
            ("rradius.rx", "root.ty", "a translation needs `scale`"),
            ("max_speed = 90", "", "missing field `max_speed`"),
        ];
        for (from, to, expected) in cases {
            let error = error(from, to);
            assert!(error.contains(expected), "{to:?}: {error}");
            assert!(error.starts_with("puppet.toml"), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    #[test]
    fn names_and_ids_are_unique() {
        let twice = |other: &str| format!("{:#}", map(&format!("{ELBOW}\n[[joint]]\n{other}")).unwrap_err());
        let same_name = twice(&ELBOW.replace("id = 3", "id = 4"));
        assert!(same_name.contains("line 10, key \"name\": another joint has this name"), "{same_name}");
        let same_id = twice(&ELBOW.replace("'elbow'", "'other'"));
        assert!(same_id.contains("line 12, key \"id\": joint \"elbow\" has id 3 as well"), "{same_id}");
    }

    #[test]
    fn the_servo_rate_is_checked() {
        let text = format!("servo_hz = 1001\nbaud = 1\n[[joint]]\n{ELBOW}\nscale = 1000\n")
            .replace("[-90, 10]", "[-1, 1]");
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        let error = format!("{:#}", puppet.map(&encoder::sample::clip().skeleton).unwrap_err());
        assert_eq!(error, "puppet.toml: the servo rate is 1001 Hz, expected 1 to 1000");
    }

    #[test]
    fn what_is_not_text_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.toml");
        fs::write(&path, b"\xff\xd8\xff\xe0").unwrap();
        let error = format!("{:#}", Puppet::read(&path).unwrap_err());
        assert!(error.contains("photo.toml: byte 0: not text"), "{error}");
    }

    #[test]
    fn the_skeleton_lies_beside_the_puppet() {
        let text = format!("skeleton = '02.asf'\nservo_hz = 50\nbaud = 1\n[[joint]]\n{ELBOW}");
        let puppet = Puppet::parse(Path::new("some/puppet.toml"), text).unwrap();
        assert_eq!(puppet.skeleton(), Some(PathBuf::from("some/02.asf")));
    }
}
