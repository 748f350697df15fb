//! Plays the linked-in clip on the servos of the linked-in map: a Sync Write packet a tick, which nobody gets.
//!
//! As in `decode`, cycles are counted from outside; `decode_frame` here is a whole tick.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;
use cortex_m_rt::entry;
use decoder_core::qmd::{Clip, Decoder};
use decoder_core::{I16F16, Limits};
use firmware::drive::buffer_len;
use firmware::dynamixel::sync_write::goal_positions;
use firmware::map::{JointMap, MAX_SERVOS};
use firmware::player::{Player, Repeat};

include!(concat!(env!("OUT_DIR"), "/sizes.rs"));

static CLIP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/clip.qmd"));
static MAP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/map.postcard"));

/// The player, and memory for a packet.
struct Stage {
    player: Player<'static, Decoder<'static, 'static>, MAX_SERVOS>,
    packet: [u8; buffer_len(MAX_SERVOS)],
}

#[entry]
fn main() -> ! {
    static mut POSE: [I16F16; CHANNELS] = [I16F16::ZERO; CHANNELS];
    static mut WORDS: [i32; TABLE] = [0; TABLE];
    static mut JOINTS: Option<JointMap<MAX_SERVOS>> = None;
    static mut STAGE: Option<Stage> = None;
    if open(STAGE, JOINTS, POSE, WORDS).is_none() {
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
    pose: &'static mut [I16F16],
    words: &'static mut [i32],
) -> Option<()> {
    let map: &'static JointMap<MAX_SERVOS> = joints.insert(JointMap::parse(black_box(MAP)).ok()?);
    let clip = Clip::parse(black_box(CLIP), Limits::MAX).ok()?;
    let table = if TABLE == 0 { None } else { Some(words) };
    let decoder = clip.decoder(pose, table).ok()?;
    let player = Player::new(decoder, clip.rate_centihertz(), map, Repeat::Once).ok()?;
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

/// Where the image ends up when all went well.
#[inline(never)]
#[unsafe(no_mangle)]
fn finished() -> ! {
    loop {
        black_box(());
    }
}

/// Where it ends up otherwise.
#[inline(never)]
#[unsafe(no_mangle)]
fn failed() -> ! {
    loop {
        black_box(1);
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    failed()
}
