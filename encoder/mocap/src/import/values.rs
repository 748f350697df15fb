//! Units of values in tables and moves, which names say or the caller.

use std::str::FromStr;

use crate::skeleton::Dof;

/// The unit of values whose names do not say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// Degrees.
    Degrees,
    /// Radians.
    Radians,
    /// What a servo is told, in the units of its bus.
    Goals,
}

impl FromStr for Values {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "degrees" => Ok(Self::Degrees),
            "radians" => Ok(Self::Radians),
            "goals" => Ok(Self::Goals),
            _ => Err(format!("found {text:?}, expected degrees, radians or goals")),
        }
    }
}

/// What stands behind the last point of a column's name, where the column holds goals.
pub const GOAL: &str = "goal";

/// The joint and what is behind the last point of a column's name, where that is a unit: `rx`, `tx`, `goal`.
pub(super) fn split(name: &str) -> Option<(&str, &str)> {
    let is_unit = |word: &str| {
        word.eq_ignore_ascii_case(GOAL) || Dof::ALL.iter().any(|dof| word.eq_ignore_ascii_case(dof.name()))
    };
    name.rsplit_once('.').filter(|(_, word)| is_unit(word))
}

/// Whether a column's name says no unit.
pub(super) fn is_open(name: &str) -> bool {
    split(name).is_none() && !name.ends_with("_deg") && !name.ends_with("_rad")
}

/// Makes degrees of radians in row-major samples, and names the columns that hold goals; `open` is the unit of those whose
/// names say none.
pub(super) fn apply(columns: &mut [String], samples: &mut [f64], open: Values) {
    let width = columns.len().max(1);
    for (index, value) in samples.iter_mut().enumerate() {
        let name = &columns[index % width];
        if name.ends_with("_rad") || (open == Values::Radians && is_open(name)) {
            *value = value.to_degrees();
        }
    }
    if open == Values::Goals {
        for name in columns.iter_mut().filter(|name| is_open(name)) {
            *name = format!("{name}.{GOAL}");
        }
    }
}
