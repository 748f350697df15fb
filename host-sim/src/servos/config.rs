//! The servos that a `puppet.toml` names.

use super::{BusConfig, ServoConfig};
use anyhow::{Context, ensure};
use serde::Deserialize;
use std::path::Path;

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
    fn errors_say_what_is_missing() {
        let error = |text| format!("{:#}", parse(text).unwrap_err());
        assert!(error("").contains("[[joint]]"));
        assert!(error("[[joint]]\nchannel = 'a'\n").contains("missing field `id`"));
        assert!(error("[[joint]]\nid = 300\n").contains("line 2"));
    }
}
