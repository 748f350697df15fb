//! What all images have in common: `bunraku bench peers` runs them as `bunraku profile` runs our own decoder (see
//! tests/profile-image), and loads the stored motion beside them.

use crate::Store;
use crate::ends::{failed, finished};
use crate::loaded::{File, Number};
use core::hint::black_box;
use cortex_m_rt::entry;

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

/// Bytes of a frame.
pub const FRAME: usize = 2 * CHANNELS;

/// The stored motion.
#[unsafe(no_mangle)]
static STORE: File = File::NONE;

/// 1 where frames are stored as differences to the frame before.
#[unsafe(no_mangle)]
static DELTA: Number = Number::NONE;

/// The motion and the pose in it.
struct Player {
    store: Store,
    delta: bool,
    pose: [i16; CHANNELS],
}

#[entry]
fn main() -> ! {
    static mut PLAYER: Option<Player> = None;
    let Some(player) = open(PLAYER, STORE.bytes()) else { failed() };
    while let Some(pose) = decode_frame(player) {
        black_box(pose);
    }
    finished()
}

#[inline(never)]
#[unsafe(no_mangle)]
fn open<'p>(player: &'p mut Option<Player>, bytes: &'static [u8]) -> Option<&'p mut Player> {
    let store = Store::new(bytes)?;
    Some(player.insert(Player { store, delta: DELTA.get() != 0, pose: [0; CHANNELS] }))
}

/// What is measured: one frame.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame(player: &mut Player) -> Option<&[i16]> {
    let (values, _) = player.store.frame()?.as_chunks::<2>();
    // An engineer's player would do one or the other: one question a frame, and not one a channel.
    if player.delta {
        for (channel, &value) in player.pose.iter_mut().zip(values) {
            *channel = channel.wrapping_add(i16::from_le_bytes(value));
        }
    } else {
        for (channel, &value) in player.pose.iter_mut().zip(values) {
            *channel = i16::from_le_bytes(value);
        }
    }
    Some(&player.pose)
}
