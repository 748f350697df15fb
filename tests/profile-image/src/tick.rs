//! Plays the linked-in clip on the servos of the linked-in map: a Sync Write packet a tick, which nobody gets.
//!
//! As in `decode`, cycles are counted from outside; `decode_frame` here is a whole tick.
#![no_std]
#![no_main]

mod ends;
#[cfg_attr(mclip, path = "store_mclip.rs")]
#[cfg_attr(not(mclip), path = "store_qmd.rs")]
mod store;

use core::hint::black_box;
use cortex_m_rt::entry;
use ends::{failed, finished};
use firmware::drive::buffer_len;
use firmware::dynamixel::sync_write::goal_positions;
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::player::{Player, Repeat};
use store::{Decoder, Memory};

static MAP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/map.postcard"));

/// The player, and memory for a packet.
struct Stage {
    player: Player<'static, Decoder, MAX_SERVOS>,
    packet: [u8; buffer_len(MAX_SERVOS)],
}

#[entry]
fn main() -> ! {
    static mut MEMORY: Memory = Memory::EMPTY;
    static mut JOINTS: Option<JointMap<MAX_SERVOS>> = None;
    static mut STAGE: Option<Stage> = None;
    if open(STAGE, JOINTS, MEMORY).is_none() {
        failed();
    }
    let Some(stage) = STAGE else { failed() };
    while let Some(packet) = decode_frame(stage) {
        black_box(packet);
    }
    finished()
}

#[inline(never)]
#[unsafe(no_mangle)]
fn open(
    stage: &mut Option<Stage>,
    joints: &'static mut Option<JointMap<MAX_SERVOS>>,
    memory: &'static mut Memory,
) -> Option<()> {
    let map: &'static JointMap<MAX_SERVOS> = joints.insert(JointMap::parse(black_box(MAP)).ok()?);
    let (decoder, rate_centihertz) = store::decoder(memory).ok()?;
    let player = Player::new(decoder, rate_centihertz, map, Repeat::Once).ok()?;
    *stage = Some(Stage { player, packet: [0; buffer_len(MAX_SERVOS)] });
    Some(())
}

/// What is measured: decode, interpolate, limit, and write the packet.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame(stage: &mut Stage) -> Option<&[u8]> {
    let goals = stage.player.tick()?;
    goal_positions(&mut stage.packet, goals).ok()
}
