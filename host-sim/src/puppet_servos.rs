//! The servos that a `puppet.toml` names.

use anyhow::{Context, anyhow, ensure};
use firmware::map::BusKind;
use puppet_file::models::{self, Model};
use serde::Deserialize;
use std::path::Path;
use toml::Table;
use virtual_servos::blender::BlenderSink;
use virtual_servos::config::{ConfigError, ServoConfig};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::protocol1::Protocol1Servos;
use virtual_servos::protocol1_models::Protocol1Family;
use virtual_servos::virtual_bus::{Disturbance, VirtualBus};

/// What servos need of a puppet; everything else in the file is for the player.
#[derive(Deserialize)]
struct Puppet {
    #[serde(default)]
    bus: Vec<Named>,
    #[serde(default)]
    joint: Vec<Joint>,
}

#[derive(Deserialize)]
struct Named {
    name: String,
    #[serde(deserialize_with = "puppet_file::bus_kind")]
    kind: BusKind,
}

#[derive(Deserialize)]
struct Joint {
    id: u8,
    bus: Option<String>,
    goal_range: Option<[i32; 2]>,
    model: Option<Model>,
}

/// A bus of a puppet and the servos on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServedBus {
    /// Its name; of a puppet's only bus that has none, "bus".
    pub name: String,
    /// What it speaks.
    pub kind: BusKind,
    /// Its servos in the order of the file, each with its model number where the puppet says one.
    pub servos: Vec<(ServoConfig, Option<u16>)>,
}

impl ServedBus {
    /// The servos, virtual; none where they hang on a board's pins. A Dynamixel X is an XM430-W350, whatever model the
    /// puppet says.
    ///
    /// # Errors
    /// As [`DynamixelServos::new`].
    pub fn virtual_bus(&self, byte_gap_us: u64) -> Result<Option<Box<dyn VirtualBus>>, ConfigError> {
        let servos = || self.servos.iter().map(|(servo, _)| *servo);
        Ok(Some(match (self.kind, protocol1_family(self.kind)) {
            (_, Some(family)) => Box::new(Protocol1Servos::new(family, &self.servos, byte_gap_us)?),
            (BusKind::Dynamixel, _) => {
                Box::new(DynamixelServos::new(&DynamixelConfig { servos: servos().collect(), byte_gap_us })?)
            }
            (BusKind::Blender, _) => Box::new(BlenderSink::new(servos().map(|servo| servo.id).collect())),
            _ => return Ok(None),
        }))
    }
}

/// The servos on such a bus, where they have the frame of protocol 1.0.
const fn protocol1_family(kind: BusKind) -> Option<Protocol1Family> {
    match kind {
        BusKind::Dynamixel1 => Some(Protocol1Family::AxMx),
        BusKind::Sts => Some(Protocol1Family::Sts),
        BusKind::Scs => Some(Protocol1Family::Scs),
        BusKind::Dynamixel | BusKind::Pwm | BusKind::Pca9685 | BusKind::Blender => None,
    }
}

/// Reads the buses of a puppet and their servos: an `id` for each `[[joint]]`, and as position limits its `goal_range`
/// where given. A puppet that names no `[[bus]]` has one of Dynamixel X.
///
/// # Errors
/// A sentence with the file and, for what is not TOML or no number, the line.
pub fn read(path: &Path) -> anyhow::Result<Vec<ServedBus>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).with_context(|| format!("{} does not describe servos", path.display()))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Events {
    event: Vec<Table>,
}

/// Reads what is to happen to servos, with the time of each in microseconds: tables `[[event]]` with `at` (seconds)
/// and
/// `what`, one of `restart` (`servo`), `silence` (`servo`, `seconds`), `cut` (`seconds`) and `turn` (`servo`,
/// `position`); with the name of the `bus`, where an event says it.
///
/// # Errors
/// A sentence with the file and the event.
pub fn read_events(path: &Path) -> anyhow::Result<Vec<(u64, Option<String>, Disturbance)>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let events =
        toml::from_str(&text).with_context(|| format!("{} does not describe events", path.display()));
    let Events { event } = events?;
    let timed = |(index, mut table): (usize, Table)| {
        let context = || format!("{}: event {}", path.display(), index + 1);
        let at = at(&mut table).with_context(context)?;
        let bus = table.remove("bus").map(|bus| bus.try_into()).transpose().with_context(context)?;
        Ok(((at * 1e6) as u64, bus, disturbance(table).with_context(context)?))
    };
    event.into_iter().enumerate().map(timed).collect()
}

/// Takes out when an event happens, in seconds.
///
/// # Errors
/// A sentence where it does not say that.
pub(crate) fn at(event: &mut Table) -> anyhow::Result<f64> {
    let at = event.remove("at").context("expected `at`, in seconds")?;
    let seconds = at.as_float().or(at.as_integer().map(|seconds| seconds as f64));
    let seconds = seconds.filter(|seconds| (0.0..1e6).contains(seconds));
    seconds.with_context(|| format!("`at` is {at}, expected seconds"))
}

/// What an event does to servos, without its time.
///
/// # Errors
/// A sentence where it is none.
pub(crate) fn disturbance(event: Table) -> anyhow::Result<Disturbance> {
    let disturbance =
        event.try_into::<Disturbance>().map_err(|error| anyhow::anyhow!("{}", error.message()))?;
    if let Disturbance::Silence { seconds, .. } | Disturbance::Cut { seconds } = disturbance {
        ensure!((0.0..1e6).contains(&seconds), "`seconds` is {seconds}, expected 0 or more");
    }
    Ok(disturbance)
}

fn parse(text: &str) -> anyhow::Result<Vec<ServedBus>> {
    let puppet: Puppet = toml::from_str(text)?;
    ensure!(!puppet.joint.is_empty(), "found no table [[joint]], expected one with an id for each servo");
    let served = |bus: Named| ServedBus { name: bus.name, kind: bus.kind, servos: Vec::new() };
    let mut buses: Vec<ServedBus> = puppet.bus.into_iter().map(served).collect();
    if buses.is_empty() {
        buses.push(served(Named { name: "bus".to_owned(), kind: BusKind::Dynamixel }));
    }
    for joint in puppet.joint {
        let id = joint.id;
        let bus = match (&joint.bus, buses.as_mut_slice()) {
            (None, [only]) => Some(only),
            (None, _) => None,
            (Some(name), buses) => buses.iter_mut().find(|bus| bus.name == *name),
        };
        let bus = bus.with_context(|| format!("the joint with the id {id} is on no bus that is there"))?;
        let model =
            joint.model.map(|model| models::number(&model)).transpose().map_err(|why| anyhow!(why))?;
        let most = protocol1_family(bus.kind).map_or(4095, |family| family.max_position(model));
        let [one, other] = joint.goal_range.unwrap_or([0, most]);
        let (min_position, max_position) = (one.min(other), one.max(other));
        let position = (most + 1) / 2;
        bus.servos.push((ServoConfig { id, position, min_position, max_position }, model));
    }
    Ok(buses)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_ids_and_limits_and_leaves_the_rest_to_others() {
        let text = "name = 'marionette'\n[[joint]]\nid = 7\nscale = 1.5\n[[joint]]\nid = 3\ngoal_range = [1000, 4095]\n";
        let served = parse(text).unwrap();
        let servos =
            [(ServoConfig::new(7), None), (ServoConfig { min_position: 1000, ..ServoConfig::new(3) }, None)];
        let bus = ServedBus { name: "bus".to_owned(), kind: BusKind::Dynamixel, servos: servos.to_vec() };
        assert_eq!(served, [bus]);
    }

    #[test]
    fn each_joint_is_on_its_bus() {
        let text = "[[bus]]\nname = 'arm'\nkind = 'dynamixel1'\n[[bus]]\nname = 'face'\nkind = 'pwm'\n\
            [[joint]]\nid = 1\nbus = 'arm'\nmodel = 'MX-28'\n[[joint]]\nid = 1\nbus = 'face'\n[[joint]]\nid = 2\nbus = 'arm'\n";
        let served = parse(text).unwrap();
        let most =
            |bus: &ServedBus| bus.servos.iter().map(|(servo, _)| servo.max_position).collect::<Vec<_>>();
        assert_eq!(served.iter().map(most).collect::<Vec<_>>(), [vec![4095, 1023], vec![4095]]);
        assert_eq!(served[0].servos[0].1, Some(29));
        assert!(served[0].virtual_bus(0).unwrap().is_some() && served[1].virtual_bus(0).unwrap().is_none());
        let error = parse(&text.replace("bus = 'face'", "bus = 'leg'")).unwrap_err();
        assert!(error.to_string().contains("id 1 is on no bus"), "{error}");
    }

    #[test]
    fn events_have_a_time_and_say_what_they_do() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read_events(&path).map_err(|error| format!("{error:#}"))
        };
        let events = read(
            "[[event]]\nat = 1.5\nwhat = 'restart'\nservo = 3\nbus = 'arm'\n[[event]]\nat = 2\nwhat = 'cut'\nseconds = 0.1\n",
        );
        assert_eq!(
            events.unwrap(),
            [
                (1_500_000, Some("arm".to_owned()), Disturbance::Restart { servo: 3 }),
                (2_000_000, None, Disturbance::Cut { seconds: 0.1 })
            ]
        );
        for (text, expected) in [
            ("[[event]]\nwhat = 'cut'\nseconds = 1\n", "event 1: expected `at`"),
            ("[[event]]\nat = -1\nwhat = 'cut'\nseconds = 1.0\n", "`at` is -1"),
            ("[[event]]\nat = 1\nwhat = 'cut'\nseconds = -1.0\n", "`seconds` is -1"),
            ("[[event]]\nat = 1\nwhat = 'explode'\n", "unknown variant `explode`"),
            ("[[event]]\nat = 1\nwhat = 'cut'\nseconds = 1.0\nservo = 3\n", "unknown field `servo`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains("events.toml") && error.contains(expected), "{error}");
        }
    }

    #[test]
    fn errors_say_what_is_missing() {
        let error = |text| format!("{:#}", parse(text).unwrap_err());
        assert!(error("").contains("[[joint]]"));
        assert!(error("[[joint]]\nchannel = 'a'\n").contains("missing field `id`"));
        assert!(error("[[joint]]\nid = 300\n").contains("line 2"));
    }
}
