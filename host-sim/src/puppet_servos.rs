//! The servos that a `puppet.toml` names.

use anyhow::{Context, ensure};
use firmware::map::BusKind;
use puppet_file::{NamedServo, Puppet};
use serde::Deserialize;
use servo_wire::dynamixel::table::MODEL_NUMBER;
use std::path::Path;
use toml::Table;
use virtual_servos::blender::BlenderSink;
use virtual_servos::config::{ConfigError, ServoConfig};
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::protocol1::Protocol1Servos;
use virtual_servos::protocol1_models::Protocol1Family;
use virtual_servos::virtual_bus::{Disturbance, VirtualBus};

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
    /// The servos, virtual; none where they hang on a board's pins. A Dynamixel X has the model number that the puppet says, and is an
    /// XM430-W350 or, of the series XL330 and XC330, has its indirect addresses where those have them.
    ///
    /// # Errors
    /// As [`DynamixelServos::new`].
    pub fn virtual_bus(&self, byte_gap_us: u64) -> Result<Option<Box<dyn VirtualBus>>, ConfigError> {
        let servos = || self.servos.iter().map(|(servo, _)| *servo);
        Ok(Some(match (self.kind, protocol1_family(self.kind)) {
            (_, Some(family)) => Box::new(Protocol1Servos::new(family, &self.servos, byte_gap_us)?),
            (BusKind::Dynamixel, _) => {
                let config = DynamixelConfig { servos: servos().collect(), byte_gap_us };
                let mut bus = DynamixelServos::new(&config)?;
                for (servo, model) in &self.servos {
                    if let Some(model) = *model {
                        let (servo, address, value) = (servo.id, MODEL_NUMBER.address, model.into());
                        bus.schedule(0, Disturbance::Set { servo, address, value })?;
                    }
                }
                Box::new(bus)
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

/// Reads the buses of a puppet and their servos: those of its joints, each at its home, which stay within their `goal_range` where
/// it is given.
///
/// # Errors
/// A sentence with the file, the line and the key.
pub fn read(path: &Path) -> anyhow::Result<Vec<ServedBus>> {
    let puppet = Puppet::read(path)?;
    // A puppet with mistakes has servos too.
    let map = puppet.channels().and_then(|channels| puppet.map(channels)).ok();
    let home = |bus: usize, id: u8| {
        let joint =
            map.as_ref()?.joints().iter().find(|joint| (usize::from(joint.bus), joint.id) == (bus, id));
        joint.map(|joint| joint.home)
    };
    let buses = puppet.bus_names().into_iter().zip(puppet.buses()?);
    let mut buses: Vec<ServedBus> =
        buses.map(|(name, bus)| ServedBus { name, kind: bus.kind, servos: Vec::new() }).collect();
    for NamedServo { bus, id, model, goal_range, .. } in puppet.servos()? {
        let home = home(bus, id);
        let bus = buses.get_mut(bus).context("a joint is on no bus that is there")?;
        let most = protocol1_family(bus.kind).map_or(4095, |family| family.max_position(model));
        let [one, other] = goal_range.unwrap_or([0, most]);
        let (min_position, max_position) = (one.min(other), one.max(other));
        // Where the puppet is at rest: a joint that stands outside its range is moved by nobody.
        let position = home.unwrap_or((most + 1) / 2).clamp(min_position.min(max_position), max_position);
        bus.servos.push((ServoConfig { id, position, min_position, max_position }, model));
    }
    ensure!(
        buses.iter().any(|bus| !bus.servos.is_empty()),
        "{}: found no table [[joint]], expected one for each servo",
        path.display()
    );
    Ok(buses)
}

/// A bus of servos in the middle of their turn, whom no puppet names.
#[must_use]
pub fn without_puppet(kind: BusKind, ids: &[u8]) -> ServedBus {
    let most = protocol1_family(kind).map_or(4095, |family| family.max_position(None));
    let servo =
        |&id: &u8| (ServoConfig { id, position: (most + 1) / 2, min_position: 0, max_position: most }, None);
    ServedBus { name: "bus".to_owned(), kind, servos: ids.iter().map(servo).collect() }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Events {
    event: Vec<Table>,
}

/// Reads what is to happen to servos, with the time of each in microseconds: tables `[[event]]` with `at` (seconds)
/// and
/// `what`, one of `restart` (`servo`), `silence` (`servo`, `seconds`), `cut` (`seconds`), `turn` (`servo`, `position`) and
/// `set` (`servo`, `address`, `value`); with the name of the `bus`, where an event says it.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a puppet of these lines and joints, each of which has the lines of its own.
    fn read_puppet(head: &str, joints: &[&str]) -> Result<Vec<ServedBus>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("puppet.toml");
        let mut text = format!("servo_hz = 50\n{head}\n");
        for (number, own) in joints.iter().enumerate() {
            let shared = format!("name = '{number}'\nchannel = 'a.rx'\nmax_speed = 90\n");
            let range = if own.contains("goal_range") { "" } else { "range = [0, 10]\n" };
            text += &["[[joint]]\n", &shared, range, own, "\n"].concat();
        }
        std::fs::write(&path, text).unwrap();
        read(&path).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn takes_ids_and_limits_and_leaves_the_rest_to_others() {
        let served = read_puppet("baud = 57600", &["id = 7", "id = 3\ngoal_range = [4095, 1000]"]).unwrap();
        let servos =
            [(ServoConfig::new(7), None), (ServoConfig { min_position: 1000, ..ServoConfig::new(3) }, None)];
        let bus = ServedBus { name: "bus".to_owned(), kind: BusKind::Dynamixel, servos: servos.to_vec() };
        assert_eq!(served, [bus]);
    }

    #[test]
    fn each_joint_is_on_its_bus() {
        let buses = "[[bus]]\nname = 'arm'\nkind = 'dynamixel1'\nbaud = 57600\n\
            [[bus]]\nname = 'face'\nkind = 'pwm'\nbaud = 50";
        let on = |name: &str| {
            let face = format!("id = 1\nbus = '{name}'");
            read_puppet(buses, &["id = 1\nbus = 'arm'\nmodel = 'MX-28'", &face, "id = 2\nbus = 'arm'"])
        };
        let served = on("face").unwrap();
        let most =
            |bus: &ServedBus| bus.servos.iter().map(|(servo, _)| servo.max_position).collect::<Vec<_>>();
        assert_eq!(served.iter().map(most).collect::<Vec<_>>(), [vec![4095, 1023], vec![4095]]);
        assert_eq!(served[0].servos[0].1, Some(29));
        assert!(served[0].virtual_bus(0).unwrap().is_some() && served[1].virtual_bus(0).unwrap().is_none());
        let error = on("leg").unwrap_err();
        assert!(error.contains("puppet.toml, line ") && error.contains("\"leg\""), "{error}");
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
        let error = |joints: &[&str]| read_puppet("baud = 57600", joints).unwrap_err();
        assert!(error(&[]).contains("missing field `joint`"), "{}", error(&[]));
        for (own, expected) in [
            ("", "missing field `id`"),
            ("id = 300", "line 8"),
            ("id = 3\ngoal_range = [1]", "line 8, key \"goal_range\""),
        ] {
            assert!(error(&[own]).contains(expected), "{}", error(&[own]));
        }
    }
}
