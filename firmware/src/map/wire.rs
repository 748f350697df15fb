//! The bytes of a joint map. docs/MAP.md describes them; tests hold the page and this file together.
//!
//! [postcard](https://postcard.jamesmunns.com/wire-format) writes the fields of [`MapBytes`], [`Settings`], [`BusSpec`]
//! and [`Joint`] in the order of their declaration. So that order is part of the format: a field is added behind
//! [`MapBytes`] only, as the digest of the channels' names was, with a new [`VERSION`]. Choices are written as the numbers that `numbered!` gives them.

use super::bus::{BusSpec, MAX_BUSES};
use super::joint::Joint;
use super::settings::Settings;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Version of the bytes, the first one of them.
pub const VERSION: u8 = 4;

/// The version before, which is read too: it ends after the joints.
pub(super) const OLD_VERSION: u8 = 3;

/// Bytes that a map of this many joints takes at most: a joint 52, the rest 69.
pub const fn bytes_len(joints: usize) -> usize {
    joints.saturating_mul(52).saturating_add(69)
}

/// What the bytes of a map hold, in order.
#[derive(Serialize, Deserialize)]
pub(super) struct MapBytes<const N: usize> {
    pub(super) version: u8,
    pub(super) settings: Settings,
    pub(super) buses: Vec<BusSpec, MAX_BUSES>,
    pub(super) joints: Vec<Joint, N>,
}
