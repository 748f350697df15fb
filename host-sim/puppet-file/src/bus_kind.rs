//! The kind of a bus as puppet.toml names it.

use firmware::map::BusKind;
use serde::de::{Deserialize, Deserializer, Error};

/// Every name, for what is told of one that is none of them.
const NAMES: [&str; BusKind::ALL.len()] = {
    let mut names = [""; BusKind::ALL.len()];
    let mut index = 0;
    while index < names.len() {
        names[index] = BusKind::ALL[index].name();
        index += 1;
    }
    names
};

/// Reads the name of a kind, for `#[serde(deserialize_with = "...")]`.
///
/// # Errors
/// A sentence with all names, where the value is none of them.
pub(crate) fn bus_kind<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BusKind, D::Error> {
    let name = String::deserialize(deserializer)?;
    BusKind::from_name(&name).ok_or_else(|| D::Error::unknown_variant(&name, &NAMES))
}
