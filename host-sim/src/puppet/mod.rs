//! The puppet: which servo follows which channel of a skeleton, as a person writes it in `puppet.toml`.
//!
//! ```toml
//! skeleton = "02.asf"       # optional: where channel names are looked up, relative to this file
//! servo_hz = 50             # goals per second, 1 to 1000
//! baud = 1_000_000          # of the servo bus; Dynamixel protocol 2.0
//!
//! # All of these are optional; the values are those that hold where they are not given.
//! interpolation = "cubic"   # or "linear"
//! on_fault = "hold"         # or "home", "torque-off" (which drops a standing puppet)
//! ease_seconds = 2.0        # least time to a first pose, and home
//! ease_speed = 0.25         # part of each joint's max_speed that is used for it
//! fade_seconds = 0.5        # between clips
//! temperature_limit = 70    # degrees Celsius; 0: only what servos say themselves counts
//! min_volts = 0.0           # supply below which is a fault; 0: not looked at
//! servo_watchdog_ms = 200   # silence after which servos stop by themselves; 0: never
//!
//! [[joint]]
//! name = "right elbow"
//! channel = "rradius.rx"    # joint.axis of the skeleton
//! id = 3                    # of the servo, 0 to 252
//! zero = 1024               # goal at channel value 0; the middle of the servo unless given
//! direction = -1            # 1 (unless given) or -1
//! scale = 11.378            # goal units per degree or cm; the servo's own unless given (rotations only)
//! range = [0, 150]          # lowest and highest channel value, in degrees or cm
//! home = 10                 # channel value at rest; 0 unless given
//! max_speed = 270           # degrees or cm per second
//! max_acceleration = 5400   # degrees or cm per second squared; max_speed in 50 ms unless given
//! idle = { breathing = 1.0, sway = 0.5, gaze = 0.0 }  # degrees or cm that the idle layer adds at most; 0 unless given
//! model = "XM430-W350"      # optional, a name or a number: what `bunraku puppet scan` expects to find there
//! ```
//!
//! Instead of `range`, `goal_range = [min, max]` gives the range in goal units: those of the kind of servo.
//!
//! A puppet with other servos than Dynamixel X on one bus names its buses instead of `baud`, and each joint its bus:
//!
//! ```toml
//! [[bus]]
//! name = "face"
//! kind = "pca9685"          # dynamixel, dynamixel1, sts, scs, pwm, pca9685, blender
//! baud = 50                 # bits per second; of pwm and pca9685 the pulses per second, and ids are numbers of outputs from 0
//! ```

use crate::files;
use anyhow::{Context, Result, anyhow, bail};
use firmware::map::{
    BusKind, BusSpec, Interpolation, Joint, JointMap, MAX_BUSES, MAX_SERVOS, Policy, Settings, bytes_len,
};
use servo_wire::pca9685::CHANNELS;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

pub mod budget;
pub mod calibrate;
mod channels;
pub(crate) mod file;
mod joint;
pub mod models;
pub mod rehearse;

pub use channels::{Channels, on_skeleton};
use file::{Curve, Entry, File, OnFault};

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

/// A servo as a puppet.toml names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Number of its bus.
    pub bus: usize,
    /// Its id there.
    pub id: u8,
    /// The joint's name.
    pub name: String,
    /// Its model number, where the puppet says it.
    pub model: Option<u16>,
}

/// What is wrong with a puppet, so far.
#[derive(Debug, Default)]
struct Mistakes(Vec<anyhow::Error>);

impl Mistakes {
    fn add(&mut self, mistake: anyhow::Error) {
        self.0.push(mistake);
    }

    /// What there is of a result; its error is kept.
    fn note<T>(&mut self, result: Result<T>) -> Option<T> {
        result.map_err(|error| self.add(error)).ok()
    }
}

/// A puppet.toml whose keys and value types are right; [`Puppet::map`] checks what they say.
#[derive(Debug)]
pub struct Puppet {
    path: PathBuf,
    text: String,
    file: File,
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

    /// The names of its buses, in the order of the map; one that has none is "bus".
    pub fn bus_names(&self) -> Vec<String> {
        match self.file.bus.as_slice() {
            [] => vec!["bus".to_owned()],
            buses => buses.iter().map(|bus| bus.name.get_ref().clone()).collect(),
        }
    }

    /// The joint map of clips with these channels (a skeleton's, or a clip's own): names resolved, units converted.
    ///
    /// # Errors
    /// A sentence that names the file, the line, the key, what was found, and what was expected: the first of those
    /// that [`check`](Self::check) gives.
    pub fn map(&self, channels: impl Into<Channels>) -> Result<Map> {
        self.check(channels).map_err(|mistakes| {
            mistakes.into_iter().next().unwrap_or_else(|| anyhow!("{}", self.path.display()))
        })
    }

    /// As [`map`](Self::map), with all mistakes there are.
    ///
    /// # Errors
    /// A sentence for each mistake, one at least.
    pub fn check(&self, channels: impl Into<Channels>) -> Result<Map, Vec<anyhow::Error>> {
        let channels = channels.into();
        let mut mistakes = Mistakes::default();
        let buses = mistakes.note(self.buses());
        let settings = mistakes.note(self.settings(&channels));
        let mut joints: Vec<(u8, Joint)> = Vec::new();
        for (index, entry) in self.file.joint.iter().enumerate() {
            let earlier = self.file.joint.iter().take(index);
            if earlier.clone().any(|other| other.name.get_ref() == entry.name.get_ref()) {
                mistakes.add(self.wrong(&entry.name, "another joint has this name"));
            }
            let bus = mistakes.note(self.bus_of(entry));
            let same = earlier.into_iter().find(|other| {
                other.id.get_ref() == entry.id.get_ref() && self.bus_of(other).ok() == bus && bus.is_some()
            });
            if let Some(other) = same {
                let why = format!("joint \"{}\" has id {} as well", other.name.get_ref(), other.id.get_ref());
                mistakes.add(self.wrong(&entry.id, &why));
            }
            mistakes.note(self.model(entry));
            let kind = bus.and_then(|bus| buses.as_ref()?.get(usize::from(bus)).map(|bus| bus.kind));
            let kind = kind.unwrap_or(BusKind::Dynamixel);
            if kind == BusKind::Pca9685 && usize::from(*entry.id.get_ref()) >= CHANNELS {
                let why =
                    format!("a PCA9685 has the channels 0 to {}, which its servos' ids are", CHANNELS - 1);
                mistakes.add(self.wrong(&entry.id, &why));
            }
            joints.extend(
                self.joint(entry, bus.unwrap_or(0), kind, &channels, &mut mistakes)
                    .map(|joint| (joint.bus, joint)),
            );
        }
        // A device goes through its buses in order.
        joints.sort_by_key(|(bus, _)| *bus);
        if joints.len() > MAX_SERVOS {
            mistakes.add(anyhow!(
                "{}: more than {MAX_SERVOS} joints, the most that a board holds",
                self.path.display()
            ));
        }
        let joints = joints.into_iter().take(MAX_SERVOS).map(|(_, joint)| joint).collect();
        if let (Some(buses), Some(settings), true) = (buses, settings, mistakes.0.is_empty()) {
            let map = JointMap::new(settings, buses, joints);
            if let Some(map) = mistakes.note(map.with_context(|| self.path.display().to_string())) {
                return Ok(map);
            }
        }
        Err(mistakes.0)
    }

    /// The servos without what they follow: number of the bus, id and name, in the order of the file.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn servos(&self) -> Result<Vec<Named>> {
        let named = |entry: &Entry| {
            let (bus, name) = (self.bus_of(entry)?, entry.name.get_ref().clone());
            Ok(Named { bus: bus.into(), id: *entry.id.get_ref(), name, model: self.model(entry)? })
        };
        self.file.joint.iter().map(named).collect()
    }

    /// What the servos hang on.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn bus_specs(&self) -> Result<Vec<BusSpec>> {
        Ok(self.buses()?.to_vec())
    }

    /// The name of a joint of [`map`](Self::map).
    pub fn name_of(&self, joint: &Joint) -> &str {
        let is =
            |entry: &&Entry| *entry.id.get_ref() == joint.id && self.bus_of(entry).ok() == Some(joint.bus);
        self.file.joint.iter().find(is).map_or("", |entry| entry.name.get_ref())
    }

    /// Text and path, as they were read.
    pub fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    fn settings(&self, channels: &Channels) -> Result<Settings> {
        let file = &self.file;
        let fallback = Settings::new(*file.servo_hz.get_ref());
        let scaled = |value: &Option<Spanned<f64>>, scale: f64, most: f64, fallback: u16| match value {
            None => Ok(fallback),
            Some(value) => match *value.get_ref() {
                found if (0.0..=most).contains(&found) => Ok((found * scale).round() as u16),
                found => Err(self.wrong(value, &format!("found {found}, expected 0 to {most}"))),
            },
        };
        Ok(Settings {
            interpolation: match file.interpolation {
                Some(Curve::Linear) => Interpolation::Linear,
                Some(Curve::Cubic) => Interpolation::CatmullRom,
                None => fallback.interpolation,
            },
            policy: match file.on_fault {
                Some(OnFault::Hold) => Policy::Hold,
                Some(OnFault::Home) => Policy::EaseHome,
                Some(OnFault::TorqueOff) => Policy::TorqueOff,
                None => fallback.policy,
            },
            ease_millis: scaled(&file.ease_seconds, 1000.0, 60.0, fallback.ease_millis)?,
            ease_velocity: scaled(&file.ease_speed, 256.0, 1.0, fallback.ease_velocity)?,
            fade_millis: scaled(&file.fade_seconds, 1000.0, 60.0, fallback.fade_millis)?,
            temperature_limit: file.temperature_limit.unwrap_or(fallback.temperature_limit),
            min_millivolts: scaled(&file.min_volts, 1000.0, 60.0, fallback.min_millivolts)?,
            servo_watchdog_millis: file.servo_watchdog_ms.unwrap_or(fallback.servo_watchdog_millis),
            channels: u16::try_from(channels.len()).unwrap_or(0),
            ..fallback
        })
    }

    fn buses(&self) -> Result<heapless::Vec<BusSpec, MAX_BUSES>> {
        let file = &self.file;
        match (&file.baud, file.bus.as_slice()) {
            (Some(baud), []) => {
                Ok([BusSpec { kind: BusKind::Dynamixel, baud: *baud.get_ref() }].into_iter().collect())
            }
            (None, []) => {
                bail!("{}: expected `baud`, or a [[bus]] with its `kind` and `baud`", self.path.display())
            }
            (Some(baud), _) => Err(self.wrong(baud, "a puppet with [[bus]] has the `baud` there")),
            (None, entries) => {
                let mut buses = heapless::Vec::new();
                for (index, entry) in entries.iter().enumerate() {
                    if entries.iter().take(index).any(|other| other.name.get_ref() == entry.name.get_ref()) {
                        return Err(self.wrong(&entry.name, "another bus has this name"));
                    }
                    if *entry.baud.get_ref() == 0 {
                        return Err(self.wrong(&entry.baud, "found 0, expected more"));
                    }
                    buses
                        .push(BusSpec { kind: entry.kind, baud: *entry.baud.get_ref() })
                        .map_err(|_| self.wrong(&entry.name, &format!("more than {MAX_BUSES} buses")))?;
                }
                Ok(buses)
            }
        }
    }

    /// The number of a joint's bus.
    fn bus_of(&self, entry: &Entry) -> Result<u8> {
        match &entry.bus {
            None if self.file.bus.len() < 2 => Ok(0),
            None => Err(self.wrong(&entry.name, "expected `bus`, since there are several")),
            Some(name) => {
                let found = self.file.bus.iter().position(|bus| bus.name.get_ref() == name.get_ref());
                let why = || format!("there is no [[bus]] with the name \"{}\"", name.get_ref());
                Ok(u8::try_from(found.ok_or_else(|| self.wrong(name, &why()))?)?)
            }
        }
    }

    /// [`map`](Self::map) as the bytes that a device parses.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn map_bytes(&self, channels: impl Into<Channels>) -> Result<Vec<u8>> {
        to_bytes(&self.map(channels)?)
    }

    fn wrong<T>(&self, value: &Spanned<T>, why: &str) -> anyhow::Error {
        self.wrong_at(value.span(), why)
    }

    fn wrong_at(&self, span: Range<usize>, why: &str) -> anyhow::Error {
        anyhow!("{}{}: {why}", self.path.display(), place(&self.text, span))
    }
}

/// `, line 12, key "id"`: where a byte range of the file is.
pub(crate) fn place(text: &str, span: Range<usize>) -> String {
    let before = text.get(..span.start).unwrap_or(text);
    let number = before.matches('\n').count() + 1;
    let line = text.lines().nth(number - 1).unwrap_or_default();
    match line.split_once('=') {
        Some((key, _)) => format!(", line {number}, key \"{}\"", key.trim()),
        None => format!(", line {number}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::I16F16;
    use std::fs;

    /// One joint, with these lines in it, on the embedded sample's skeleton.
    fn map(lines: &str) -> Result<Map> {
        let text = format!("servo_hz = 50\nbaud = 1_000_000\n[[joint]]\n{lines}\n");
        Puppet::parse(Path::new("puppet.toml"), text)?.map(&mocap::sample::clip().skeleton)
    }

    const ELBOW: &str = "name = 'elbow'\nchannel = 'rradius.rx'\nid = 3\nrange = [-90, 10]\nmax_speed = 90";

    fn error(from: &str, to: &str) -> String {
        assert!(ELBOW.contains(from));
        format!("{:#}", map(&ELBOW.replace(from, to)).unwrap_err())
    }

    #[test]
    fn units_are_converted() {
        let skeleton = mocap::sample::clip().skeleton;
        let joint = map(ELBOW).unwrap().joints()[0];
        assert_eq!(skeleton.channels[usize::from(joint.channel)].name, "rradius.rx");
        // 90° are a quarter of 4096, 10° are 113.8; 90°/s at 50 Hz are 20.48 a tick, reached in 2.5 ticks.
        assert_eq!((joint.id, joint.zero, joint.min, joint.max, joint.home), (3, 2048, 1024, 2162, 2048));
        assert_eq!((joint.max_velocity, joint.max_acceleration), (20_971, 8_388));
        assert!((joint.scale.to_num::<f64>() - 4096.0 / 360.0).abs() < 1e-5);
        assert_eq!((joint.goal(I16F16::from_num(-45)) + 512) >> 10, 1536);

        let turned = map(&format!("{ELBOW}\ndirection = -1\nzero = 1000")).unwrap().joints()[0];
        assert_eq!((turned.min, turned.max), (886, 2024));
        assert_eq!((turned.goal(I16F16::from_num(-45)) + 512) >> 10, 1512);

        let goals = map(&ELBOW.replace("range = [-90, 10]", "goal_range = [2100, 2000]\nscale = 2.5"));
        let joint = goals.unwrap().joints()[0];
        assert_eq!((joint.min, joint.max, joint.scale), (2000, 2100, I16F16::lit("2.5")));
        assert_eq!(joint.max_velocity, (4.5 * 1024.0) as i32);

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
            (
                "max_speed = 90",
                "max_speed = 0.001",
                "line 8, key \"max_speed\": too slow for a servo at 50 Hz",
            ),
            ("max_speed = 90", "max_speed = 90\nhome = 20", "line 9, key \"home\": this is goal 2276"),
            ("max_speed = 90", "max_speed = 90\nidle = { gaze = 200 }", "more than the joint's range"),
            ("max_speed = 90", "max_speed = 90\nidle = { smile = 2 }", "unknown field `smile`"),
            ("max_speed = 90", "max_speed = 90\nbus = 'arm'", "no [[bus]] with the name \"arm\""),
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
    fn what_a_puppet_does_not_say_has_a_value_and_what_it_says_counts() {
        let with = |lines: &str| {
            let text = format!("servo_hz = 50\n{lines}\n[[joint]]\n{ELBOW}\n");
            Puppet::parse(Path::new("puppet.toml"), text)?.map(&mocap::sample::clip().skeleton)
        };
        assert_eq!(*with("baud = 1").unwrap().settings(), Settings { channels: 31, ..Settings::new(50) });
        let all = "baud = 1\ninterpolation = 'linear'\non_fault = 'torque-off'\nease_seconds = 1.5\nease_speed = 1\n\
                   fade_seconds = 0\ntemperature_limit = 60\nmin_volts = 9.5\nservo_watchdog_ms = 0";
        let expected = Settings {
            tick_hz: 50,
            interpolation: Interpolation::Linear,
            policy: Policy::TorqueOff,
            ease_millis: 1500,
            ease_velocity: 256,
            fade_millis: 0,
            temperature_limit: 60,
            min_millivolts: 9500,
            servo_watchdog_millis: 0,
            channels: 31,
        };
        assert_eq!(*with(all).unwrap().settings(), expected);
        let errors = [
            ("", "expected `baud`"),
            ("baud = 1\nease_speed = 2", "line 3, key \"ease_speed\": found 2, expected 0 to 1"),
            ("baud = 1\nease_speed = 0", "the velocity of easing is 0/256"),
            ("baud = 1\non_fault = 'panic'", "unknown variant `panic`"),
            ("baud = 1\n[[bus]]\nname = 'a'\nkind = 'sts'\nbaud = 1", "has the `baud` there"),
            ("[[bus]]\nname = 'a'\nkind = 'sts'\nbaud = 0", "line 5, key \"baud\": found 0"),
        ];
        for (lines, expected) in errors {
            let error = format!("{:#}", with(lines).unwrap_err());
            assert!(error.contains(expected), "{lines}: {error}");
        }
    }

    #[test]
    fn joints_of_several_buses_are_in_their_order_and_have_their_units() {
        let bus = |name: &str, kind: &str| format!("[[bus]]\nname = '{name}'\nkind = '{kind}'\nbaud = 50\n");
        let joint = |name: &str, bus: &str| {
            let lines = ELBOW.replace("'elbow'", &format!("'{name}'")).replace("[-90, 10]", "[-80, 10]");
            format!("[[joint]]\nbus = '{bus}'\n{lines}\n")
        };
        let text = format!(
            "servo_hz = 50\n{}{}{}{}{}",
            bus("arm", "sts"),
            bus("face", "pwm"),
            joint("a", "face"),
            joint("b", "arm"),
            joint("c", "arm").replace("id = 3", "id = 4"),
        );
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        let map = puppet.map(&mocap::sample::clip().skeleton).unwrap();
        let found: Vec<_> = map.joints().iter().map(|joint| (joint.bus, joint.id, joint.min)).collect();
        assert_eq!(found, [(0, 3, 1138), (0, 4, 1138), (1, 3, 611)]);
        assert_eq!(map.buses()[1], BusSpec { kind: BusKind::Pwm, baud: 50 });
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
    fn all_mistakes_are_told() {
        let text = "servo_hz = 50\nbaud = 1\nease_speed = 2\n[[joint]]\nname = 'a'\nchannel = 'rradus.rx'\nid = 3\nrange = [-90, 10]\n\
                    max_speed = -1\nmodel = 'XM999'\n[[joint]]\nname = 'a'\nchannel = 'rradius.rx'\nid = 3\nrange = [-200, 10]\nhome = 70\n\
                    max_speed = 0.001\nidle = { gaze = 900 }\n";
        let puppet = Puppet::parse(Path::new("puppet.toml"), text.to_owned()).unwrap();
        let mistakes = puppet.check(&mocap::sample::clip().skeleton).unwrap_err();
        let lines: Vec<String> = mistakes
            .iter()
            .map(|mistake| {
                let text = format!("{mistake:#}");
                text.split(", ").nth(1).unwrap().to_owned() + " " + text.split('"').nth(1).unwrap_or_default()
            })
            .collect();
        let expected = [
            "line 3 ease_speed",
            "line 10 model",
            "line 6 channel",
            "line 9 max_speed",
            "line 12 name",
            "line 14 id",
            "line 15 range",
            "line 17 max_speed",
            "line 18 idle",
        ];
        assert_eq!(lines, expected.map(|line| line.to_owned()), "{mistakes:#?}");
        assert!(format!("{}", mistakes[1]).contains("XM430-W350"), "{}", mistakes[1]);
    }

    #[test]
    fn the_servo_rate_is_checked() {
        let text = format!("servo_hz = 1001\nbaud = 1\n[[joint]]\n{ELBOW}\nscale = 1000\n")
            .replace("[-90, 10]", "[-1, 1]");
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        let error = format!("{:#}", puppet.map(&mocap::sample::clip().skeleton).unwrap_err());
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
