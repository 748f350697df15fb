//! Plays a clip on the servos of a joint map: a Sync Write packet a tick, which nobody gets.
//!
//! As in `decode`, cycles are counted from outside; `decode_frame` here is a whole tick of a machine that plays.
#![no_std]
#![no_main]

mod ends;
mod lend;
mod loaded;
#[cfg_attr(feature = "mclip", path = "store_mclip.rs")]
#[cfg_attr(not(feature = "mclip"), path = "store_qmd.rs")]
mod store;

use core::hint::black_box;
use cortex_m_rt::entry;
use ends::{failed, finished};
use firmware::decoder_list::SingleClip;
use firmware::machine::{After, IdealServos, Machine, Show, Start, State};
use firmware::map::{JointMap, MAX_SERVOS};
use loaded::File;
use servo_wire::dynamixel::sync_write::{goal_positions, goal_positions_len};
use store::Decoder;

/// The joint map.
#[unsafe(no_mangle)]
static MAP: File = File::NONE;

/// The machine, its servos, and memory for a packet.
struct Rehearsal {
    machine: Machine<'static, SingleClip<Decoder>, MAX_SERVOS>,
    servos: IdealServos<MAX_SERVOS>,
    packet: [u8; goal_positions_len(MAX_SERVOS)],
}

/// Ticks that it may take to the first pose: more than a minute at the highest rate.
const TICKS_TO_FIRST_POSE: u32 = 100_000;

#[entry]
fn main() -> ! {
    static mut JOINTS: Option<JointMap<MAX_SERVOS>> = None;
    static mut REHEARSAL: Option<Rehearsal> = None;
    if open(REHEARSAL, JOINTS).is_none() {
        failed();
    }
    let Some(rehearsal) = REHEARSAL else { failed() };
    while let Some(packet) = decode_frame(rehearsal) {
        black_box(packet);
    }
    finished()
}

#[inline(never)]
#[unsafe(no_mangle)]
fn open(rehearsal: &mut Option<Rehearsal>, joints: &'static mut Option<JointMap<MAX_SERVOS>>) -> Option<()> {
    let map: &'static JointMap<MAX_SERVOS> = joints.insert(JointMap::parse(MAP.bytes()).ok()?);
    let (decoder, rate_centihertz) = store::decoder().ok()?;
    let library = SingleClip::new(decoder, Some(rate_centihertz));
    let show = Show { playlist: &[0], after: After::Hold, ..Show::default() };
    let mut machine = Machine::new(map, library, show, Start::Power);
    let mut servos = IdealServos::new(&machine);
    if !servos.until_it_plays(&mut machine, TICKS_TO_FIRST_POSE) {
        return None;
    }
    *rehearsal = Some(Rehearsal { machine, servos, packet: [0; goal_positions_len(MAX_SERVOS)] });
    Some(())
}

/// What is measured: look at the servos, decode, interpolate, blend, limit, and write the packet.
#[inline(never)]
#[unsafe(no_mangle)]
fn decode_frame(rehearsal: &mut Rehearsal) -> Option<&[u8]> {
    if rehearsal.machine.state() != State::Playing {
        return None;
    }
    let goals = rehearsal.servos.tick(&mut rehearsal.machine);
    goal_positions(&mut rehearsal.packet, goals).ok()
}
