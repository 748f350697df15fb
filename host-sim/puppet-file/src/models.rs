//! Names of servos' model numbers.
//!
//! Source: e-Manual, "Model Number" in the control table of each Dynamixel; Feetech's memory tables, where the number
//! is the first byte and 256 times the second one.

use firmware::map::BusKind;
use serde::Deserialize;

/// MX servos with protocol 1.0.
pub(crate) const MX_12W: u16 = 360;
pub(crate) const MX_28: u16 = 29;
pub(crate) const MX_64: u16 = 310;
pub(crate) const MX_106: u16 = 320;
/// The SCS servo that turns 300 degrees.
pub(crate) const SCS0009: u16 = 1284;

/// Models whose goal units are those of their kind of bus in puppet.toml.
const MODELS: [(&str, u16); 44] = [
    ("AX-12A", 12),
    ("AX-12W", 300),
    ("AX-18A", 18),
    ("MX-12W", MX_12W),
    ("MX-28", MX_28),
    ("MX-64", MX_64),
    ("MX-106", MX_106),
    ("MX-28(2.0)", 30),
    ("MX-64(2.0)", 311),
    ("MX-106(2.0)", 321),
    ("XL320", 350),
    ("XL330-M077", 1190),
    ("XL330-M288", 1200),
    ("XC330-T181", 1210),
    ("XC330-T288", 1220),
    ("XC330-M181", 1230),
    ("XC330-M288", 1240),
    ("XL430-W250", 1060),
    ("2XL430-W250", 1090),
    ("XC430-W150", 1070),
    ("XC430-W240", 1080),
    ("2XC430-W250", 1160),
    ("XM430-W210", 1030),
    ("XM430-W350", 1020),
    ("XH430-W210", 1010),
    ("XH430-W350", 1000),
    ("XH430-V210", 1050),
    ("XH430-V350", 1040),
    ("XD430-T210", 1011),
    ("XD430-T350", 1001),
    ("XW430-T200", 1280),
    ("XW430-T333", 1270),
    ("XM540-W150", 1130),
    ("XM540-W270", 1120),
    ("XH540-W150", 1110),
    ("XH540-W270", 1100),
    ("XH540-V150", 1150),
    ("XH540-V270", 1140),
    ("XD540-T150", 1111),
    ("XD540-T270", 1101),
    ("XW540-T140", 1180),
    ("XW540-T260", 1170),
    ("STS3215", 777),
    ("SCS0009", SCS0009),
];

/// The name of a model, or its number where it has none here.
pub fn name(model: u16) -> String {
    let known = MODELS.iter().find(|(_, number)| *number == model);
    known.map_or_else(|| format!("model {model}"), |(name, _)| (*name).to_owned())
}

/// A name that no model here has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the model \"{name}\" is not known; the nearest are {}; its number does too", .nearest.join(", "))]
pub struct UnknownModel {
    /// The name.
    pub name: String,
    /// Names that are like it, the likest first.
    pub nearest: [&'static str; 3],
}

/// A servo's model as a person writes it.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Model {
    /// Its number.
    Number(u16),
    /// Its name.
    Name(String),
}

/// The number of a model.
///
/// # Errors
/// [`UnknownModel`] for a name that is none of those here.
pub fn number(model: &Model) -> Result<u16, UnknownModel> {
    let wanted = match model {
        Model::Number(number) => return Ok(*number),
        Model::Name(name) => name,
    };
    if let Some((_, number)) = MODELS.iter().find(|(name, _)| name.eq_ignore_ascii_case(wanted)) {
        return Ok(*number);
    }
    let mut near = MODELS.map(|(name, _)| name);
    // What models begin with is their series.
    let likeness = |name: &str| strsim::jaro_winkler(name, wanted);
    near.sort_by(|one, other| likeness(other).total_cmp(&likeness(one)));
    let [first, second, third, ..] = near;
    Err(UnknownModel { name: wanted.clone(), nearest: [first, second, third] })
}

/// Why a servo of this model does not do what a bus of this kind expects, if it does not.
pub fn unfit(kind: BusKind, model: u16) -> Option<&'static str> {
    match kind {
        BusKind::Dynamixel if model == 350 => Some("an XL320 has another control table, and 1024 positions"),
        BusKind::Dynamixel if (2000..3000).contains(&model) || model > 30_000 => {
            Some("servos of the P and PRO series have another control table")
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_belong_together() {
        for (index, (text, model)) in MODELS.iter().enumerate() {
            assert_eq!(name(*model), *text, "{model} stands twice");
            assert_eq!(number(&Model::Name(text.to_lowercase())), Ok(*model));
            assert!(MODELS.iter().take(index).all(|(other, _)| other != text));
        }
        assert_eq!(name(4711), "model 4711");
        assert!(number(&Model::Name("XM430-W35".into())).unwrap_err().nearest.contains(&"XM430-W350"));
        assert!(unfit(BusKind::Dynamixel, 350).is_some() && unfit(BusKind::Dynamixel, 1020).is_none());
    }
}
