//! docs/MAP.md and the code of the joint map, held against each other.
#![allow(clippy::unwrap_used)]

use bunraku_tests::workspace;
use decoder_core::I16F16;
use firmware::clock::MAX_TICK_HZ;
use firmware::limits::MAX_VELOCITY;
use firmware::map::{
    BusKind, BusSpec, GOAL_LIMIT, Idle, Interpolation, Joint, JointMap, MAX_BUSES, MAX_SERVOS, Policy,
    Settings, VERSION,
};
use puppet_file::{Map, Puppet, to_bytes};
use servo_wire::dynamixel::MAX_ID;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the golden maps.
fn maps() -> PathBuf {
    workspace().join("tests/vectors/maps")
}

/// The rows of the first table after a heading of docs/MAP.md, without the heads of their columns.
fn rows(heading: &str) -> Vec<Vec<String>> {
    let page = fs::read_to_string(workspace().join("docs/MAP.md")).unwrap();
    let lines = page.lines().skip_while(|line| *line != heading).skip(1);
    let table = lines.skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
    };
    let rows: Vec<_> = table.skip(2).map(cells).collect();
    assert!(!rows.is_empty(), "docs/MAP.md has no table after \"{heading}\"");
    rows
}

/// Number and name of each row.
fn numbers(heading: &str) -> Vec<(u8, String)> {
    rows(heading).into_iter().map(|row| (row[0].parse().unwrap(), row[1].clone())).collect()
}

/// The map of a puppet with these lines.
fn map(lines: &str) -> Map {
    let joint = "[[joint]]\nname = 'a'\nchannel = 'a.rx'\nid = 1\nrange = [0, 1]\nmax_speed = 100\n";
    let puppet = Puppet::parse(Path::new("puppet.toml"), format!("servo_hz = 50\n{lines}\n{joint}")).unwrap();
    puppet.map(puppet.channels().unwrap()).unwrap()
}

#[test]
fn the_pages_limits_are_those_of_the_code() {
    let found: Vec<(String, i64)> =
        rows("## Limits").into_iter().map(|row| (row[0].clone(), row[1].parse().unwrap())).collect();
    let expected = [
        ("version", i64::from(VERSION)),
        ("buses", MAX_BUSES as i64),
        ("joints", MAX_SERVOS as i64),
        ("highest id", i64::from(MAX_ID)),
        ("highest rate", i64::from(MAX_TICK_HZ)),
        ("highest goal", i64::from(GOAL_LIMIT)),
        ("highest velocity", i64::from(MAX_VELOCITY)),
    ];
    assert_eq!(found, expected.map(|(name, value)| (name.to_owned(), value)));
}

#[test]
fn the_pages_numbers_are_those_of_the_code() {
    let found: Vec<_> = BusKind::ALL.iter().map(|kind| (kind.number(), kind.name().to_owned())).collect();
    assert_eq!(numbers("### kind"), found);
    let interpolation = |name| map(&format!("baud = 1\ninterpolation = '{name}'")).settings().interpolation;
    let curves = numbers("### interpolation");
    let found: Vec<_> = curves.iter().map(|(_, name)| (interpolation(name).number(), name.clone())).collect();
    assert_eq!((found.len(), found), (Interpolation::ALL.len(), curves));
    let policy = |name| map(&format!("baud = 1\non_fault = '{name}'")).settings().policy;
    let policies = numbers("### policy");
    let found: Vec<_> = policies.iter().map(|(_, name)| (policy(name).number(), name.clone())).collect();
    assert_eq!((found.len(), found), (Policy::ALL.len(), policies));
}

/// A map in which each field has another value than its neighbours.
fn example() -> Map {
    let settings = Settings {
        tick_hz: 50,
        interpolation: Interpolation::Linear,
        policy: Policy::TorqueOff,
        ease_millis: 2000,
        ease_velocity: 64,
        fade_millis: 500,
        temperature_limit: 70,
        min_millivolts: 9500,
        servo_watchdog_millis: 200,
        channels: 31,
        following_tenths: 100,
    };
    let buses =
        [BusSpec { kind: BusKind::Dynamixel, baud: 1_000_000 }, BusSpec { kind: BusKind::Pca9685, baud: 50 }];
    let elbow = Joint {
        channel: 9,
        bus: 0,
        id: 3,
        zero: 2048,
        home: 2000,
        scale: I16F16::from_bits(-745_654),
        min: 1000,
        max: 3000,
        max_velocity: 20_971,
        max_acceleration: 8_388,
        idle: Idle { breathing: 3, sway: -4, gaze: 0 },
    };
    let jaw = Joint { channel: 130, bus: 1, id: 15, zero: 1500, home: 1500, min: 500, max: 2500, ..elbow };
    let joints = [elbow, jaw];
    let map = JointMap::new(settings, buses.into_iter().collect(), joints.into_iter().collect()).unwrap();
    map.with_names(0xcafe_1234)
}

/// Names of the fields, their types, and their values in the example; `None` for a value with parts.
fn fields(map: &Map) -> Vec<(&'static str, &'static str, i64)> {
    let settings = map.settings();
    let mut fields = vec![
        ("version", "byte", i64::from(VERSION)),
        ("servo rate", "unsigned", settings.tick_hz.into()),
        ("interpolation", "choice", settings.interpolation.number().into()),
        ("policy", "choice", settings.policy.number().into()),
        ("ease time", "unsigned", settings.ease_millis.into()),
        ("ease velocity", "unsigned", settings.ease_velocity.into()),
        ("fade time", "unsigned", settings.fade_millis.into()),
        ("temperature limit", "byte", settings.temperature_limit.into()),
        ("least supply", "unsigned", settings.min_millivolts.into()),
        ("servo watchdog", "unsigned", settings.servo_watchdog_millis.into()),
        ("channels", "unsigned", settings.channels.into()),
        ("buses", "count", map.buses().len() as i64),
    ];
    for bus in map.buses() {
        fields.extend([("kind", "choice", bus.kind.number().into()), ("baud", "unsigned", bus.baud.into())]);
    }
    fields.push(("joints", "count", map.joints().len() as i64));
    for joint in map.joints() {
        fields.extend([
            ("channel", "unsigned", joint.channel.into()),
            ("bus", "byte", joint.bus.into()),
            ("id", "byte", joint.id.into()),
            ("zero", "signed", joint.zero.into()),
            ("home", "signed", joint.home.into()),
            ("scale", "signed", joint.scale.to_bits().into()),
            ("lowest goal", "signed", joint.min.into()),
            ("highest goal", "signed", joint.max.into()),
            ("velocity", "signed", joint.max_velocity.into()),
            ("acceleration", "signed", joint.max_acceleration.into()),
            ("breathing", "signed", joint.idle.breathing.into()),
            ("sway", "signed", joint.idle.sway.into()),
            ("gaze", "signed", joint.idle.gaze.into()),
        ]);
    }
    fields.push(("names", "unsigned", map.names().into()));
    fields.push(("following error", "unsigned", map.settings().following_tenths.into()));
    fields
}

/// A value as the page says that its type is written.
fn written(kind: &str, value: i64) -> Vec<u8> {
    let mut rest = match kind {
        "byte" | "choice" | "count" => return vec![u8::try_from(value).unwrap()],
        "signed" if value < 0 => -2 * value - 1,
        "signed" => 2 * value,
        _ => value,
    };
    let mut bytes = Vec::new();
    while rest > 127 {
        bytes.push((rest & 127) as u8 | 128);
        rest >>= 7;
    }
    bytes.push(rest as u8);
    bytes
}

#[test]
fn the_pages_example_is_what_the_code_writes() {
    let map = example();
    let mut table = "| field | value | bytes |\n|---|---:|---|\n".to_owned();
    let mut bytes = Vec::new();
    for (name, kind, value) in fields(&map) {
        let part = written(kind, value);
        let hex: Vec<String> = part.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(table, "| {name} | {value} | {} |", hex.join(" ")).unwrap();
        bytes.extend(part);
    }
    assert_eq!(to_bytes(&map), bytes);
    let page = fs::read_to_string(workspace().join("docs/MAP.md")).unwrap();
    assert!(page.contains(&table), "the example of docs/MAP.md is not this one:\n{table}");
    assert!(page.contains(&format!("{} bytes", bytes.len())), "the example has {} bytes", bytes.len());
    assert_eq!(fs::read(maps().join("example-5.map")).unwrap(), bytes);
    // Version 4 had no following error, which is then the usual one.
    let before = fs::read(maps().join("example-4.map")).unwrap();
    assert_eq!(Map::parse(&before), Ok(map.clone()));
    assert!(Map::parse(&[&before[..], &[0]].concat()).is_err(), "nothing follows a map of version 4");
    // Version 3, whose bytes stay readable as well, had no names.
    let before = fs::read(maps().join("example.map")).unwrap();
    assert_eq!(Map::parse(&before), Ok(map.clone().with_names(0)));
    assert!(Map::parse(&[&before[..], &[0]].concat()).is_err(), "nothing follows a map of version 3");
    assert_eq!(Map::parse(&bytes), Ok(map));
}

/// The fields of the page's tables, in order, are those that the code writes, with the page's types.
#[test]
fn the_pages_fields_are_those_of_the_code() {
    let of = |heading| rows(heading).into_iter().filter(|row| row[0] != "…").collect::<Vec<_>>();
    let (map, bus, joint) = (of("## The map"), of("### A bus"), of("### A joint"));
    let (settings, last) = map.split_at(map.len() - 3);
    let page = [settings, &bus, &bus, &last[..1], &joint, &joint, &last[1..]].concat();
    let page: Vec<_> = page.iter().map(|row| (row[0].as_str(), row[1].as_str())).collect();
    let example = example();
    let code: Vec<_> = fields(&example).into_iter().map(|(name, kind, _)| (name, kind)).collect();
    assert_eq!(page, code);
}

/// What puppets of this project have become on devices, they become for ever.
#[test]
fn puppets_keep_their_bytes() {
    for name in ["sample", "hobby", "sample-buses"] {
        let puppet = Puppet::read(&workspace().join("puppets").join(format!("{name}.toml"))).unwrap();
        let map = puppet.map(&mocap::sample::clip().skeleton).unwrap();
        let golden = maps().join(format!("{name}.map"));
        let before = fs::read(&golden).unwrap();
        // The golden maps are of version 3; the names and the following error are behind all of that.
        assert_eq!(map.names(), 0x07f8_8633, "the digest of the sample's names");
        let now = [
            &[VERSION][..],
            &before[1..],
            &written("unsigned", map.names().into()),
            &written("unsigned", 100),
        ]
        .concat();
        assert_eq!(to_bytes(&map), now, "{}", golden.display());
        assert_eq!(Map::parse(&before), Ok(map.with_names(0)), "{}", golden.display());
    }
}

#[test]
fn numbers_without_a_meaning_are_refused() {
    let bytes = to_bytes(&example());
    // The places of interpolation, policy and the first bus's kind.
    for (place, most) in [(2, 1), (3, 2), (16, 6)] {
        let with = |number| {
            let mut bytes = bytes.clone();
            bytes[place] = number;
            Map::parse(&bytes)
        };
        assert!(with(most).is_ok(), "{place}");
        for number in [most + 1, 127, 128, 255] {
            assert!(with(number).is_err(), "{number} at {place}");
        }
    }
}
