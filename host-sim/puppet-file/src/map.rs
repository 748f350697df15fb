//! From the entries of a puppet.toml to a joint map.

use crate::channels::Channels;
use crate::error::{Error, Mistakes, Problem};
use crate::file::{Curve, OnFault};
use crate::place::FILLER;
use crate::puppet::Puppet;
use firmware::clock::MAX_TICK_HZ;
use firmware::map::{BusKind, Interpolation, Joint, JointMap, MAX_SERVOS, Policy, Settings, bytes_len};
use servo_wire::dynamixel::MAX_ID;
use servo_wire::pca9685::CHANNELS;
use toml::Spanned;

/// The joint map of this project's puppets, as a device has it: at most [`MAX_SERVOS`] joints.
pub type Map = JointMap<MAX_SERVOS>;

/// A map as the bytes that a device parses (docs/MAP.md).
///
/// # Panics
/// Never: [`bytes_len`] bytes hold every map that can be made.
pub fn to_bytes(map: &Map) -> Vec<u8> {
    let mut buffer = [0; bytes_len(MAX_SERVOS)];
    map.to_bytes(&mut buffer).expect("`bytes_len` bytes hold every map").to_vec()
}

impl Puppet {
    /// The joint map for clips with these channels, a skeleton's or a clip's own: names resolved, units converted.
    ///
    /// # Errors
    /// The first of the mistakes that [`check`](Self::check) gives.
    pub fn map(&self, channels: impl Into<Channels>) -> Result<Map, Error> {
        self.check(channels).map_err(|mut mistakes| mistakes.swap_remove(0))
    }

    /// As [`map`](Self::map), with all mistakes there are, in the order of the file for each joint.
    ///
    /// # Errors
    /// One mistake at least.
    pub fn check(&self, channels: impl Into<Channels>) -> Result<Map, Vec<Error>> {
        let channels = channels.into();
        let mut mistakes = Mistakes::default();
        let buses = self.all_buses().map_err(|all| mistakes.add_all(all)).ok();
        let settings = self.settings(&channels, &mut mistakes);
        self.check_chains(&mut mistakes);
        let mut joints: Vec<Joint> = Vec::new();
        for (index, entry) in self.file.joint.iter().enumerate() {
            let earlier = self.file.joint.iter().take(index);
            if earlier.clone().any(|other| other.name.get_ref() == entry.name.get_ref()) {
                mistakes.add(self.wrong(&entry.name, Problem::JointTwice));
            }
            self.check_name(&entry.name, &mut mistakes);
            let bus = mistakes.note(self.bus_of(entry));
            let same = earlier.into_iter().find(|other| {
                let id = other.id.get_ref() == entry.id.get_ref() && other.id.span() != FILLER;
                id && self.bus_of(other).ok() == bus && bus.is_some()
            });
            if let Some(other) = same {
                let (joint, id) = (other.name.get_ref().clone(), *other.id.get_ref());
                mistakes.add(self.wrong(&entry.id, Problem::IdTwice { joint, id }));
            }
            let id = *entry.id.get_ref();
            if id > MAX_ID {
                let (found, least, most) = (id.into(), 0.0, MAX_ID.into());
                mistakes.add(self.wrong(&entry.id, Problem::OutOfRange { found, least, most }));
            }
            mistakes.note(self.model(entry));
            self.check_follows(entry, &mut mistakes);
            let kind = bus.and_then(|bus| buses.as_ref()?.get(usize::from(bus)).map(|bus| bus.kind));
            let kind = kind.unwrap_or(BusKind::Dynamixel);
            if kind == BusKind::Pca9685 && usize::from(id) >= CHANNELS {
                mistakes.add(self.wrong(&entry.id, Problem::Pca9685Channel));
            }
            joints.extend(self.joint(entry, bus.unwrap_or(0), kind, &channels, &mut mistakes));
        }
        // A device goes through its buses in order.
        joints.sort_by_key(|joint| joint.bus);
        if joints.len() > MAX_SERVOS {
            mistakes.add(self.wrong_at_all(Problem::TooManyJoints));
        }
        let joints = joints.into_iter().take(MAX_SERVOS).collect();
        if let (Some(buses), true) = (buses, mistakes.is_empty()) {
            let map = JointMap::new(settings, buses, joints).map_err(|error| self.wrong_at_all(error));
            if let Some(map) = mistakes.note(map) {
                return Ok(map.with_names(channels.names_digest()));
            }
        }
        Err(mistakes.into())
    }

    /// [`map`](Self::map) as the bytes that a device parses.
    ///
    /// # Errors
    /// As [`map`](Self::map).
    pub fn map_bytes(&self, channels: impl Into<Channels>) -> Result<Vec<u8>, Error> {
        Ok(to_bytes(&self.map(channels)?))
    }

    fn settings(&self, channels: &Channels, mistakes: &mut Mistakes) -> Settings {
        let file = &self.file;
        let fallback = Settings::new(self.servo_hz());
        let servo_hz = *file.servo_hz.get_ref();
        if !(1..=MAX_TICK_HZ).contains(&servo_hz) {
            let (found, least, most) = (servo_hz.into(), 1.0, MAX_TICK_HZ.into());
            mistakes.add(self.wrong(&file.servo_hz, Problem::OutOfRange { found, least, most }));
        }
        let mut scaled =
            |value: &Option<Spanned<f64>>, scale: f64, [least, most]: [f64; 2], fallback: u16| {
                let Some(value) = value else { return fallback };
                let found = *value.get_ref();
                if !(least..=most).contains(&found) {
                    mistakes.add(self.wrong(value, Problem::OutOfRange { found, least, most }));
                }
                (found * scale).round() as u16
            };
        let seconds = [0.0, 60.0];
        Settings {
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
            ease_millis: scaled(&file.ease_seconds, 1000.0, seconds, fallback.ease_millis),
            ease_velocity: scaled(&file.ease_speed, 256.0, [0.004, 1.0], fallback.ease_velocity),
            fade_millis: scaled(&file.fade_seconds, 1000.0, seconds, fallback.fade_millis),
            temperature_limit: file.temperature_limit.unwrap_or(fallback.temperature_limit),
            min_millivolts: scaled(&file.min_volts, 1000.0, [0.0, 60.0], fallback.min_millivolts),
            servo_watchdog_millis: file.servo_watchdog_ms.unwrap_or(fallback.servo_watchdog_millis),
            channels: u16::try_from(channels.len()).unwrap_or(0),
            following_tenths: scaled(&file.following_error, 10.0, [0.0, 180.0], fallback.following_tenths),
            ..fallback
        }
    }

    /// Goals a second; a usual rate where the file's is none.
    pub(crate) fn servo_hz(&self) -> u16 {
        let found = *self.file.servo_hz.get_ref();
        if (1..=MAX_TICK_HZ).contains(&found) { found } else { 50 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channels::{Owner, Unit};
    use decoder_core::I16F16;
    use firmware::map::BusSpec;
    use std::path::Path;

    /// One joint, with these lines in it, on the embedded sample's skeleton.
    fn map(lines: &str) -> Result<Map, Error> {
        let text = format!("servo_hz = 50\nbaud = 1_000_000\n[[joint]]\n{lines}\n");
        Puppet::parse(Path::new("puppet.toml"), text)?.map(&mocap::sample::clip().skeleton)
    }

    const ELBOW: &str = "name = 'elbow'\nchannel = 'rradius.rx'\nid = 3\nrange = [-90, 10]\nmax_speed = 90";

    fn error(from: &str, to: &str) -> String {
        assert!(ELBOW.contains(from));
        map(&ELBOW.replace(from, to)).unwrap_err().to_string()
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
            ("id = 3", "id = 253", "line 6, key \"id\": found 253, expected 0 to 252"),
            ("id = 3", "idd = 3", "line 6, key \"idd\": unknown field `idd`"),
            ("id = 3", "id = ", "line 6, key \"id\""),
            ("range = [-90, 10]", "range = [-200, 10]", "a servo takes 0 to 4095"),
            (
                "range = [-90, 10]",
                "range = [-90, nan]",
                "line 7, key \"range\": found NaN, expected a number",
            ),
            ("range = [-90, 10]", "range = [-90, 10, 3]", "line 7, key \"range\": found 3 numbers"),
            ("range = [-90, 10]", "goal_range = [0]", "line 7, key \"goal_range\": found 1 numbers"),
            ("id = 3", "id = 3\noffset = inf", "line 7, key \"offset\": found inf, expected a number"),
            ("id = 3", "id = 3\noffset = 1e9", "line 7, key \"offset\": found 1137777"),
            (
                "id = 3",
                "id = 3\nturn = { bone = 'head', against = 'chest', axis = 'y' }",
                "line 4, key \"name\": expected one of",
            ),
            ("channel = 'rradius.rx'", "", "expected one of `channel`, `turn`, `chain` and `sum`"),
            ("channel = 'rradius.rx'", "chain = 'arm'\naxis = 'y'", "no [[chain]] with the name \"arm\""),
            (
                "channel = 'rradius.rx'",
                "turn = { bone = 'head', against = 'chest', axis = 'w' }",
                "an axis: \"x\", ",
            ),
            (
                "channel = 'rradius.rx'",
                "turn = { bone = 'head', against = 'chest', axis = [0, 0, 0] }",
                "found [0.0, 0.0, 0.0], expected an axis",
            ),
            ("channel = 'rradius.rx'", "turn = { bone = 'head', axis = 'x' }", "missing field `against`"),
            (
                "channel = 'rradius.rx'",
                "turn = { bone = 'head', against = 'chest', axis = 'x', weight = 2 }",
                "a weight belongs to",
            ),
            ("channel = 'rradius.rx'", "sum = []", "found no turns"),
            ("id = 3", "id = 3\naxis = 'x'", "`axis` belongs to a joint with `chain`"),
            (
                "max_speed = 90",
                "max_speed = 90\nmax_acceleration = 1e-308",
                "line 9, key \"max_acceleration\": too little for",
            ),
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
                   fade_seconds = 0\ntemperature_limit = 60\nmin_volts = 9.5\nservo_watchdog_ms = 0\nfollowing_error = 7.5";
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
            following_tenths: 75,
        };
        assert_eq!(*with(all).unwrap().settings(), expected);
        let errors = [
            ("", "expected `baud`"),
            ("baud = 1\nease_speed = 2", "line 3, key \"ease_speed\": found 2, expected 0.004 to 1"),
            ("baud = 1\nease_speed = 0", "found 0, expected 0.004 to 1"),
            ("baud = 1\non_fault = 'panic'", "unknown variant `panic`"),
            ("baud = 1\n[[bus]]\nname = 'a'\nkind = 'sts'\nbaud = 1", "has the `baud` there"),
            ("[[bus]]\nname = 'a'\nkind = 'sts'\nbaud = 0", "line 5, key \"baud\": found 0"),
        ];
        for (lines, expected) in errors {
            let error = format!("{}", with(lines).unwrap_err());
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
    fn chains_have_names_of_their_own_and_one_to_three_joints() {
        let chain =
            |name: &str| format!("[[chain]]\nname = '{name}'\nbone = 'right upper arm'\nagainst = 'chest'\n");
        let joint = |id: usize, line: &str| {
            ELBOW
                .replace("'elbow'", &format!("'{id}'"))
                .replace("id = 3", &format!("id = {id}"))
                .replace("channel = 'rradius.rx'", line)
                + "\n"
        };
        let mistakes = |chains: &str, joints: &[&str]| {
            let mut text = format!("servo_hz = 50\nbaud = 1\n{chains}");
            for (id, line) in joints.iter().enumerate() {
                // Each joint about another axis than the one before it.
                let axis = if id % 2 == 0 { "[0, 0, -2]" } else { "[0, 1, 0]" };
                text += &format!("[[joint]]\n{}", joint(id, &line.replace("[0, 0, -2]", axis)));
            }
            let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
            let mistakes = puppet.channels().map(|channels| puppet.check(channels)).unwrap();
            mistakes.map_or_else(
                |found| found.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"),
                |map| map.joints().len().to_string(),
            )
        };
        let arm = "chain = 'arm'\naxis = [0, 0, -2]";
        assert_eq!(mistakes(&chain("arm"), &[arm; 3]), "3");
        assert!(
            mistakes(&chain("arm"), &[arm; 4]).contains("line 4, key \"name\": 4 joints have this chain")
        );
        assert!(
            mistakes(&(chain("arm") + &chain("leg")), &[arm])
                .contains("line 8, key \"name\": 0 joints have this")
        );
        assert!(
            mistakes(&(chain("arm") + &chain("arm")), &[arm])
                .contains("line 8, key \"name\": another chain has")
        );
        assert!(
            mistakes(&chain("arm"), &["chain = 'arm'"])
                .contains("line 9, key \"chain\": a joint of a chain needs")
        );
    }

    /// The same joint from a whole skeleton's clip, where the offset is part of the map, and from a fitted one.
    #[test]
    fn a_range_need_not_contain_zero_and_an_offset_moves_what_is_followed() {
        let lines = ELBOW.replace("[-90, 10]", "[10, 90]");
        let at = |map: &Map| {
            let joint = map.joints()[0];
            (joint.channel, joint.zero, joint.min, joint.max, joint.home)
        };
        assert_eq!(at(&map(&lines).unwrap()), (24, 2048, 2162, 3072, 2162));
        let lines = format!("{lines}\noffset = 90\ndirection = -1");
        assert_eq!(at(&map(&lines).unwrap()), (24, 1024, 1024, 1934, 1934));
        let text = format!("servo_hz = 50\nbaud = 1\n[[joint]]\n{lines}\n");
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        let fitted = || {
            [("other.rx", Unit::Degree), ("elbow.rx", Unit::Degree)]
                .map(|(name, unit)| (name.to_owned(), unit))
        };
        let map = puppet.map(Channels::new(Owner::Clip, fitted())).unwrap();
        assert_eq!(at(&map), (1, 2048, 1024, 1934, 1934));
        // Beside other channels a name says nothing.
        let other = [("root.ty".to_owned(), Unit::Centimetre)];
        assert!(puppet.map(Channels::new(Owner::Clip, fitted().into_iter().chain(other))).is_err());
    }

    #[test]
    fn what_is_no_channel_needs_a_clip_of_the_puppet() {
        let line = "sum = [{ bone = 'neck', against = 'chest', axis = 'x', weight = 0.5 }, { bone = 'head', against = 'neck', axis = '-x' }]";
        let text = format!(
            "servo_hz = 50\nbaud = 1\n[[joint]]\n{}\n",
            ELBOW.replace("channel = 'rradius.rx'", line)
        );
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        assert!(puppet.needs_fit());
        assert_eq!(puppet.map(puppet.channels().unwrap()).unwrap().joints()[0].channel, 0);
        let error = puppet.map(&mocap::sample::clip().skeleton).unwrap_err().to_string();
        assert!(error.contains("line 4, key \"name\": the clip was not made for this puppet"), "{error}");
    }

    #[test]
    fn names_and_ids_are_unique() {
        let twice = |other: &str| map(&format!("{ELBOW}\n[[joint]]\n{other}")).unwrap_err().to_string();
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
        let error = format!("{}", puppet.map(&mocap::sample::clip().skeleton).unwrap_err());
        assert_eq!(error, "puppet.toml, line 1, key \"servo_hz\": found 1001, expected 1 to 1000");
    }
}
