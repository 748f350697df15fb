//! The keys of puppet.toml and the types of their values; [`Puppet`](crate::puppet::Puppet) says what they mean.

use crate::bus_kind::bus_kind;
use crate::models::Model;
use core::fmt;
use firmware::map::BusKind;
use serde::Deserialize;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use std::collections::BTreeMap;
use std::path::PathBuf;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    pub(crate) skeleton: Option<PathBuf>,
    pub(crate) servo_hz: Spanned<u16>,
    pub(crate) baud: Option<Spanned<u32>>,
    pub(crate) interpolation: Option<Curve>,
    pub(crate) on_fault: Option<OnFault>,
    pub(crate) ease_seconds: Option<Spanned<f64>>,
    pub(crate) ease_speed: Option<Spanned<f64>>,
    pub(crate) fade_seconds: Option<Spanned<f64>>,
    pub(crate) temperature_limit: Option<u8>,
    pub(crate) min_volts: Option<Spanned<f64>>,
    pub(crate) servo_watchdog_ms: Option<u16>,
    pub(crate) following_error: Option<Spanned<f64>>,
    #[serde(default)]
    pub(crate) bus: Vec<BusEntry>,
    #[serde(default)]
    pub(crate) chain: Vec<ChainEntry>,
    #[serde(default)]
    pub(crate) figure: Vec<FigureEntry>,
    pub(crate) joint: Vec<JointEntry>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Curve {
    Linear,
    Cubic,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OnFault {
    Hold,
    Home,
    TorqueOff,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BusEntry {
    pub(crate) name: Spanned<String>,
    #[serde(deserialize_with = "bus_kind")]
    pub(crate) kind: BusKind,
    pub(crate) baud: Spanned<u32>,
    pub(crate) oscillator_hz: Option<Spanned<u32>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChainEntry {
    pub(crate) name: Spanned<String>,
    pub(crate) bone: Spanned<String>,
    pub(crate) against: Spanned<String>,
}

/// What is known of a figure that the puppet plays recordings of.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FigureEntry {
    pub(crate) bones: Spanned<String>,
    pub(crate) twists: Spanned<BTreeMap<String, f64>>,
}

/// The rotation of one bone against another about an axis.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TurnEntry {
    pub(crate) bone: Spanned<String>,
    pub(crate) against: Spanned<String>,
    pub(crate) axis: Axis,
    pub(crate) weight: Option<Spanned<f64>>,
}

/// A direction of length 1 in figure axes: x to the figure's left, y up, z forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axis(pub(crate) [f64; 3]);

impl Axis {
    /// Whether the other one is the same line, but for less than 2.6 degrees.
    pub(crate) fn is_parallel(&self, other: &Self) -> bool {
        self.0.iter().zip(other.0).map(|(one, other)| one * other).sum::<f64>().abs() > 0.999
    }
}

/// What an axis may be.
const AXIS: &str = "an axis: \"x\", \"-x\", \"y\", \"-y\", \"z\", \"-z\", or three numbers as [0, 1, 0]";

impl<'de> Deserialize<'de> for Axis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;

        impl<'de> Visitor<'de> for Read {
            type Value = Axis;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(AXIS)
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Axis, E> {
                let (sign, letter) = name.strip_prefix('-').map_or((1.0, name), |letter| (-1.0, letter));
                let index = ["x", "y", "z"].iter().position(|known| *known == letter);
                let index = index.ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(name), &self))?;
                let mut axis = [0.0; 3];
                axis[index] = sign;
                Ok(Axis(axis))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<Axis, A::Error> {
                let mut found: Vec<f64> = Vec::new();
                while let Some(number) = numbers.next_element()? {
                    found.push(number);
                }
                let wrong = || A::Error::custom(format!("found {found:?}, expected {AXIS}"));
                let axis: [f64; 3] = found.as_slice().try_into().map_err(|_| wrong())?;
                let length = axis.iter().map(|part| part * part).sum::<f64>().sqrt();
                if !(length.is_finite() && length > 0.0) {
                    return Err(wrong());
                }
                Ok(Axis(axis.map(|part| part / length)))
            }
        }

        deserializer.deserialize_any(Read)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointEntry {
    pub(crate) name: Spanned<String>,
    pub(crate) channel: Option<Spanned<String>>,
    pub(crate) turn: Option<TurnEntry>,
    pub(crate) chain: Option<Spanned<String>>,
    pub(crate) sum: Option<Vec<TurnEntry>>,
    pub(crate) axis: Option<Spanned<Axis>>,
    pub(crate) offset: Option<Spanned<f64>>,
    pub(crate) bus: Option<Spanned<String>>,
    pub(crate) id: Spanned<u8>,
    pub(crate) zero: Option<Spanned<i32>>,
    pub(crate) direction: Option<Spanned<i8>>,
    pub(crate) scale: Option<Spanned<f64>>,
    pub(crate) range: Option<Spanned<Vec<f64>>>,
    pub(crate) goal_range: Option<Spanned<Vec<i32>>>,
    pub(crate) home: Option<Spanned<f64>>,
    pub(crate) max_speed: Spanned<f64>,
    pub(crate) max_acceleration: Option<Spanned<f64>>,
    pub(crate) idle: Option<Spanned<IdleEntry>>,
    pub(crate) model: Option<Spanned<Model>>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct IdleEntry {
    pub(crate) breathing: f64,
    pub(crate) sway: f64,
    pub(crate) gaze: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// The keys of a table, from the sentence about one that is none of them.
    fn keys(text: &str) -> BTreeSet<String> {
        let error = toml::from_str::<File>(text).unwrap_err().message().to_owned();
        let (_, keys) = error.split_once("expected").unwrap_or_default();
        let keys: BTreeSet<_> = keys.split('`').skip(1).step_by(2).map(ToOwned::to_owned).collect();
        assert!(keys.len() > 1, "{error}");
        keys
    }

    /// The keys in the first column of the table below a heading of docs/PUPPET.md.
    fn in_page(heading: &str) -> BTreeSet<String> {
        let page = include_str!("../../../docs/PUPPET.md");
        let lines = page.lines().skip_while(|line| *line != heading).skip(1);
        let section = lines.take_while(|line| !line.starts_with('#'));
        section.filter_map(|line| Some(line.strip_prefix("| `")?.split_once('`')?.0.to_owned())).collect()
    }

    #[test]
    fn the_page_has_the_parsers_keys() {
        let tables = [
            ("## The whole puppet", "none = 1"),
            ("## [[bus]]", "[[bus]]\nnone = 1"),
            ("## [[chain]]", "[[chain]]\nnone = 1"),
            ("## [[figure]]", "[[figure]]\nnone = 1"),
            ("## [[joint]]", "[[joint]]\nnone = 1"),
            ("### turn", "[[joint]]\nturn = { none = 1 }"),
            ("### turn", "[[joint]]\nsum = [{ none = 1 }]"),
            ("### idle", "[[joint]]\nidle = { none = 1 }"),
        ];
        for (heading, text) in tables {
            assert_eq!(in_page(heading), keys(text), "{heading} of docs/PUPPET.md");
        }
    }

    /// Each example of docs/PUPPET.md, alone and with what it lacks.
    #[test]
    fn the_pages_examples_are_puppets() {
        let examples = include_str!("../../../docs/PUPPET.md").split("```toml\n").skip(1);
        let examples: Vec<&str> = examples.filter_map(|text| text.split("```").next()).collect();
        assert_eq!(examples.len(), 7);
        let head = "servo_hz = 50\nbaud = 1\n";
        let joint = "[[joint]]\nname = 'a'\nid = 9\nchannel = 'a.rx'\nrange = [0, 1]\nmax_speed = 1\n";
        for text in examples {
            let text = match text {
                _ if text.contains("servo_hz") => format!("{text}{joint}"),
                _ if text.contains("[[figure]]") => format!("{head}{text}{joint}"),
                _ if text.contains("[[bus]]") => format!("servo_hz = 50\n{text}{joint}"),
                _ if text.starts_with("idle") => format!("{head}{joint}{text}"),
                _ => format!("{head}{text}"),
            };
            let puppet = crate::puppet::Puppet::parse(std::path::Path::new("p.toml"), text).unwrap();
            let map = puppet.map(puppet.channels().unwrap());
            assert!(map.is_ok(), "{}", map.unwrap_err());
        }
    }

    #[test]
    fn an_axis_has_length_1() {
        let turn = |axis: &str| {
            let text = format!("bone = 'a'\nagainst = 'b'\naxis = {axis}");
            toml::from_str::<TurnEntry>(&text).map(|turn| turn.axis.0)
        };
        assert_eq!(turn("'-y'").unwrap(), [0.0, -1.0, 0.0]);
        assert_eq!(turn("[0, 3, 4.0]").unwrap(), [0.0, 0.6, 0.8]);
        for wrong in ["'up'", "'--x'", "[1, 0]", "[1, 0, 0, 0]", "[0, 0, 0]", "[nan, 0, 1]", "3"] {
            assert!(turn(wrong).is_err(), "{wrong}");
        }
    }
}
