//! The joint map: which servo follows which channel of a clip, and how, and what keeps the puppet safe.
//!
//! A person writes it as `puppet.toml`; the crate `puppet-file` resolves names and units. The device gets it as bytes,
//! which docs/MAP.md describes. [`JointMap::parse`] and [`JointMap::new`] check a map once; what holds a [`JointMap`]
//! relies on that.

mod bus;
mod error;
mod joint;
mod joint_map;
mod settings;
mod wire;

pub use bus::{BusKind, BusSpec, MAX_BUSES, OSCILLATORS, PCA9685_HZ};
pub use error::MapError;
pub use joint::{GOAL_LIMIT, Idle, Joint};
pub use joint_map::{JointMap, MAX_SERVOS};
pub use settings::{Interpolation, Policy, Settings};
pub use wire::{VERSION, bytes_len};
