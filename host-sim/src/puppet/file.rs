//! The keys of puppet.toml and the types of their values; [`Puppet`](super::Puppet) says what they mean.

use firmware::map::BusKind;
use serde::Deserialize;
use std::path::PathBuf;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) skeleton: Option<PathBuf>,
    pub(super) servo_hz: Spanned<u16>,
    pub(super) baud: Option<Spanned<u32>>,
    pub(super) interpolation: Option<Curve>,
    pub(super) on_fault: Option<OnFault>,
    pub(super) ease_seconds: Option<Spanned<f64>>,
    pub(super) ease_speed: Option<Spanned<f64>>,
    pub(super) fade_seconds: Option<Spanned<f64>>,
    pub(super) temperature_limit: Option<u8>,
    pub(super) min_volts: Option<Spanned<f64>>,
    pub(super) servo_watchdog_ms: Option<u16>,
    #[serde(default)]
    pub(super) bus: Vec<BusEntry>,
    pub(super) joint: Vec<Entry>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Curve {
    Linear,
    Cubic,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum OnFault {
    Hold,
    Home,
    TorqueOff,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BusEntry {
    pub(super) name: Spanned<String>,
    pub(super) kind: BusKind,
    pub(super) baud: Spanned<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) name: Spanned<String>,
    pub(super) channel: Spanned<String>,
    pub(super) bus: Option<Spanned<String>>,
    pub(super) id: Spanned<u8>,
    pub(super) zero: Option<Spanned<i32>>,
    pub(super) direction: Option<Spanned<i8>>,
    pub(super) scale: Option<Spanned<f64>>,
    pub(super) range: Option<Spanned<[f64; 2]>>,
    pub(super) goal_range: Option<Spanned<[i32; 2]>>,
    pub(super) home: Option<Spanned<f64>>,
    pub(super) max_speed: Spanned<f64>,
    pub(super) max_acceleration: Option<Spanned<f64>>,
    pub(super) idle: Option<Spanned<IdleEntry>>,
    pub(super) model: Option<Spanned<Model>>,
}

/// A servo's model.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Model {
    /// Its number.
    Number(u16),
    /// Its name.
    Name(String),
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
pub(super) struct IdleEntry {
    pub(super) breathing: f64,
    pub(super) sway: f64,
    pub(super) gaze: f64,
}
