//! The servos that a `puppet.toml` names.

use super::{BusConfig, Deed, ServoConfig};
use anyhow::{Context, ensure};
use serde::Deserialize;
use std::path::Path;
use toml::Table;

/// What servos need of a puppet; everything else in the file is for the player.
#[derive(Deserialize)]
struct Puppet {
    #[serde(default)]
    joint: Vec<Joint>,
}

#[derive(Deserialize)]
struct Joint {
    id: u8,
    goal_range: Option<[i32; 2]>,
}

/// Reads the servos of a puppet: an `id` for each `[[joint]]`, and as position limits its `goal_range` (0 to 4095)
/// where given.
///
/// # Errors
/// A sentence with the file and, for what is not TOML or no number, the line.
pub fn read(path: &Path) -> anyhow::Result<BusConfig> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    parse(&text).with_context(|| format!("{} does not describe servos", path.display()))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Happenings {
    event: Vec<Table>,
}

/// Reads what is to happen to servos, with the time of each in microseconds: tables `[[event]]` with `at` (seconds) and
/// `what`, one of `restart` (`servo`), `silence` (`servo`, `seconds`), `cut` (`seconds`) and `turn` (`servo`, `position`).
///
/// # Errors
/// A sentence with the file and the event.
pub fn read_events(path: &Path) -> anyhow::Result<Vec<(u64, Deed)>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let events =
        toml::from_str(&text).with_context(|| format!("{} does not describe events", path.display()));
    let Happenings { event } = events?;
    let timed = |(index, mut table): (usize, Table)| {
        let context = || format!("{}: event {}", path.display(), index + 1);
        let at = at(&mut table).with_context(context)?;
        Ok(((at * 1e6) as u64, deed(table).with_context(context)?))
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
pub(crate) fn deed(event: Table) -> anyhow::Result<Deed> {
    let deed = event.try_into::<Deed>().map_err(|error| anyhow::anyhow!("{}", error.message()))?;
    if let Deed::Silence { seconds, .. } | Deed::Cut { seconds } = deed {
        ensure!((0.0..1e6).contains(&seconds), "`seconds` is {seconds}, expected 0 or more");
    }
    Ok(deed)
}

fn parse(text: &str) -> anyhow::Result<BusConfig> {
    let puppet: Puppet = toml::from_str(text)?;
    ensure!(!puppet.joint.is_empty(), "found no table [[joint]], expected one with an id for each servo");
    let servos = puppet.joint.iter().map(|joint| {
        let factory = ServoConfig::new(joint.id);
        let [one, other] = joint.goal_range.unwrap_or([factory.min_position, factory.max_position]);
        let (min_position, max_position) = (one.min(other), one.max(other));
        ServoConfig { min_position, max_position, ..factory }
    });
    Ok(BusConfig { servos: servos.collect(), ..BusConfig::with_ids(&[]) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_ids_and_limits_and_leaves_the_rest_to_others() {
        let text = "name = 'marionette'\n[[joint]]\nid = 7\nscale = 1.5\n[[joint]]\nid = 3\ngoal_range = [1000, 4095]\n";
        let config = parse(text).unwrap();
        assert_eq!(
            config.servos,
            [ServoConfig::new(7), ServoConfig { min_position: 1000, ..ServoConfig::new(3) }]
        );
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
            "[[event]]\nat = 1.5\nwhat = 'restart'\nservo = 3\n[[event]]\nat = 2\nwhat = 'cut'\nseconds = 0.1\n",
        );
        assert_eq!(
            events.unwrap(),
            [(1_500_000, Deed::Restart { servo: 3 }), (2_000_000, Deed::Cut { seconds: 0.1 })]
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
