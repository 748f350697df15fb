//! The keys of puppet.toml and the types of their values; [`Puppet`](crate::puppet::Puppet) says what they mean.

use crate::bus_kind::bus_kind;
use crate::models::Model;
use firmware::map::BusKind;
use serde::Deserialize;
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
    #[serde(default)]
    pub(crate) bus: Vec<BusEntry>,
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
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointEntry {
    pub(crate) name: Spanned<String>,
    pub(crate) channel: Spanned<String>,
    pub(crate) bus: Option<Spanned<String>>,
    pub(crate) id: Spanned<u8>,
    pub(crate) zero: Option<Spanned<i32>>,
    pub(crate) direction: Option<Spanned<i8>>,
    pub(crate) scale: Option<Spanned<f64>>,
    pub(crate) range: Option<Spanned<[f64; 2]>>,
    pub(crate) goal_range: Option<Spanned<[i32; 2]>>,
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
