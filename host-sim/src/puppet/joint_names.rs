//! What a puppet's servos are called, for people.

use firmware::fault::Fault;
use puppet_file::{Map, Puppet};
use std::fmt::Write;

/// The servos of a map with the names of their joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JointNames(Vec<(u8, String)>);

impl JointNames {
    /// Those of a puppet's map.
    pub fn of(puppet: &Puppet, map: &Map) -> Self {
        Self(map.joints().iter().map(|joint| (joint.id, puppet.name_of(joint).to_owned())).collect())
    }

    /// Those of a map whose puppet nobody knows: ids alone.
    pub fn ids(map: &Map) -> Self {
        Self::of_ids(map.joints().iter().map(|joint| joint.id))
    }

    /// Servos of whom the ids are known, in the order of their map: those that a device tells of.
    pub fn of_ids(ids: impl IntoIterator<Item = u8>) -> Self {
        Self(ids.into_iter().map(|id| (id, String::new())).collect())
    }

    /// These, or the ids of a map where there are none.
    #[must_use]
    pub fn or_ids(&self, map: &Map) -> Self {
        if self.0.is_empty() { Self::ids(map) } else { self.clone() }
    }

    /// The servo in a place of the map: "servo 7 (left elbow)".
    pub fn servo(&self, index: usize) -> String {
        match self.0.get(index) {
            Some((id, name)) if name.is_empty() => format!("servo {id}"),
            Some((id, name)) => format!("servo {id} ({name})"),
            None => format!("the servo at place {index} of the map"),
        }
    }

    /// Several of them.
    pub fn servos(&self, places: impl IntoIterator<Item = usize>) -> String {
        places.into_iter().map(|index| self.servo(index)).collect::<Vec<_>>().join(", ")
    }

    /// A fault as a sentence with the servo's id and the name of its joint.
    pub fn fault(&self, fault: Fault) -> String {
        let mut text = String::new();
        // A text takes all that is written to it.
        let _ = write!(text, "{}", fault.naming(|servo, f| f.write_str(&self.servo(servo.into()))));
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_servo_has_its_id_and_its_joints_name_whatever_its_place() {
        let text = "servo_hz = 50\nbaud = 1\n[[joint]]\nname = 'neck'\nchannel = 'root.ry'\nid = 9\nrange = [-9, 9]\n\
                    max_speed = 90\n[[joint]]\nname = 'jaw'\nchannel = 'root.rx'\nid = 3\nrange = [-9, 9]\nmax_speed = 90\n";
        let puppet = Puppet::parse(Path::new("puppet.toml"), text.to_owned()).unwrap();
        let map = puppet.map(&mocap::sample::clip().skeleton).unwrap();
        let names = JointNames::of(&puppet, &map);
        assert_eq!(names.fault(Fault::Overloaded { servo: 1 }), "servo 3 (jaw) is overloaded");
        assert_eq!(JointNames::ids(&map).fault(Fault::Silent { servo: 0 }), "servo 9 does not answer");
        assert_eq!(names.servos([0, 1]), "servo 9 (neck), servo 3 (jaw)");
        assert_eq!(names.fault(Fault::Late), "ticks come too late");
    }
}
