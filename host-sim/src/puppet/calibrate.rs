//! Puts measured positions into a puppet.toml, and leaves the rest of the file as it is.

use crate::files;
use anyhow::{Context, Result, bail};
use puppet_file::Puppet;
use toml_edit::{Array, DocumentMut, Item, Table, Value, value};

/// Where somebody held a joint, in goal units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Measured {
    /// The joint's name.
    pub name: String,
    /// Goal where its channel is 0.
    pub zero: i32,
    /// Lowest goal that it was moved to.
    pub min: i32,
    /// Highest one.
    pub max: i32,
}

/// The text of a puppet's file with these zeros and ranges; comments and order stay.
///
/// # Errors
/// A sentence for a joint that is not in the file.
pub fn with_measured(puppet: &Puppet, measured: &[Measured]) -> Result<String> {
    let (path, text) = puppet.source();
    let mut document: DocumentMut = text.parse().with_context(|| path.display().to_string())?;
    let Some(joints) = document.get_mut("joint").and_then(Item::as_array_of_tables_mut) else {
        bail!("{}: expected the joints as tables [[joint]]", path.display());
    };
    for found in measured {
        let is = |table: &&mut Table| table.get("name").and_then(Item::as_str) == Some(found.name.as_str());
        let Some(table) = joints.iter_mut().find(is) else {
            bail!("{}: there is no joint \"{}\"", path.display(), found.name);
        };
        set(table, "zero", "zero", i64::from(found.zero).into());
        let range: Array = [i64::from(found.min), found.max.into()].into_iter().collect();
        let old = if table.contains_key("range") { "range" } else { "goal_range" };
        set(table, old, "goal_range", range.into());
    }
    Ok(document.to_string())
}

/// Writes [`with_measured`] to the file.
///
/// # Errors
/// A sentence that names the file.
pub fn write_measured(puppet: &Puppet, measured: &[Measured]) -> Result<()> {
    let text = with_measured(puppet, measured)?;
    files::write(puppet.source().0, |file| Ok(file.write_all(text.as_bytes())?))
}

/// Puts `new` and its value where `old` was, with the comments that stood there; at the end if it was nowhere.
fn set(table: &mut Table, old: &str, new: &str, mut to: Value) {
    let order: Vec<String> =
        table.iter().map(|(key, _)| if key == old { new } else { key }.to_owned()).collect();
    if let Some((mut key, item)) = table.remove_entry(old) {
        if let Some(before) = item.as_value() {
            *to.decor_mut() = before.decor().clone();
        }
        if old != new {
            let decor = key.leaf_decor().clone();
            key = toml_edit::Key::new(new).with_leaf_decor(decor);
        }
        table.insert_formatted(&key, Item::Value(to));
    } else {
        table.insert(new, value(to));
    }
    let place = |key: &str| order.iter().position(|there| there == key).unwrap_or(usize::MAX);
    table.sort_values_by(|one, _, other, _| place(one.get()).cmp(&place(other.get())));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const TEXT: &str = "# A puppet.\nservo_hz = 50\nbaud = 1 # slow\n\n[[joint]]\nname = 'elbow' # right\nchannel = 'rradius.rx'\nid = 3\n\
                        # As far as the wood lets it.\nrange = [-90, 10] # degrees\nmax_speed = 90\n\n[[joint]]\nname = 'other'\n\
                        channel = 'lradius.rx'\nid = 4\nzero  =  7 # here\ngoal_range = [0, 9]\nmax_speed = 90 # end\n";

    fn puppet(text: &str) -> Puppet {
        Puppet::parse(Path::new("puppet.toml"), text.to_owned()).unwrap()
    }

    fn measured(name: &str) -> Measured {
        Measured { name: name.to_owned(), zero: 2000, min: 1500, max: 2500 }
    }

    #[test]
    fn only_what_was_measured_changes() {
        let text = with_measured(&puppet(TEXT), &[measured("elbow"), measured("other")]).unwrap();
        let expected = TEXT
            .replace(
                "range = [-90, 10] # degrees\nmax_speed = 90\n",
                "goal_range = [1500, 2500] # degrees\nmax_speed = 90\nzero = 2000\n",
            )
            .replace(
                "zero  =  7 # here\ngoal_range = [0, 9]",
                "zero  =  2000 # here\ngoal_range = [1500, 2500]",
            );
        assert_eq!(text, expected);
        let map = puppet(&text).map(&mocap::sample::clip().skeleton).unwrap();
        assert_eq!((map.joints()[0].zero, map.joints()[0].min, map.joints()[0].max), (2000, 1500, 2500));
    }

    #[test]
    fn a_joint_that_is_none_is_named() {
        let error = with_measured(&puppet(TEXT), &[measured("knee")]).unwrap_err().to_string();
        assert_eq!(error, "puppet.toml: there is no joint \"knee\"");
    }
}
