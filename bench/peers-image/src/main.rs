//! Plays motion that is stored as int16 frames, packed by one of the crates that are at hand for that.
//!
//! `bunraku bench peers` runs it as `bunraku profile` runs our own decoder: see tests/profile-image.
#![no_std]
#![no_main]

#[path = "../../../tests/profile-image/src/ends.rs"]
mod ends;
#[cfg_attr(any(feature = "heatshrink", feature = "lz4_flex", feature = "miniz_oxide"), path = "blocks.rs")]
#[cfg_attr(feature = "tamp", path = "tamp.rs")]
#[cfg_attr(
    not(any(feature = "heatshrink", feature = "lz4_flex", feature = "miniz_oxide", feature = "tamp")),
    path = "raw.rs"
)]
mod store;

use core::hint::black_box;
use cortex_m_rt::entry;
use ends::{failed, finished};
use store::Store;

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

/// Bytes of a frame.
const FRAME: usize = 2 * CHANNELS;

static STORE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/store"));

/// The motion and the pose in it.
struct Player {
    store: Store,
    pose: [i16; CHANNELS],
}

#[entry]
fn main() -> ! {
    static mut PLAYER: Option<Player> = None;
    let Some(player) = open(PLAYER, black_box(STORE)) else { failed() };
    while let Some(pose) = decode_frame(player) {
        black_box(pose);
    }
    finished()
}

#[inline(never)]
#[unsafe(no_mangle)]
fn open<'p>(player: &'p mut Option<Player>, bytes: &'static [u8]) -> Option<&'p mut Player> {
    Some(player.insert(Player { store: Store::new(bytes)?, pose: [0; CHANNELS] }))
}

/// What is measured: one frame.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame(player: &mut Player) -> Option<&[i16]> {
    let (values, _) = player.store.frame()?.as_chunks::<2>();
    for (channel, &value) in player.pose.iter_mut().zip(values) {
        let value = i16::from_le_bytes(value);
        *channel = if DELTA { channel.wrapping_add(value) } else { value };
    }
    Some(&player.pose)
}
