//! What an image is to give: the same as this machine.

use super::measure::Expected;
use crate::clip::Clip;
use anyhow::{Result, bail};
use decoder_core::I16F16;
use firmware::decoder_list::SingleClip;
use firmware::machine::{After, IdealServos, Machine, Show, Start, State};
use firmware::map::MAX_SERVOS;
use puppet_file::Map;
use servo_wire::dynamixel::sync_write::{goal_positions, goal_positions_len};

/// The frames of a clip.
///
/// # Errors
/// Those of its decoder.
pub fn frames(clip: &Clip<'_>) -> Result<Expected> {
    clip.decode(|decoder| {
        let mut frames = Vec::new();
        while let Some(frame) = decoder.next_frame()? {
            frames.push(frame.iter().flat_map(|value| value.to_le_bytes()).collect());
        }
        Ok(Expected { element: size_of::<I16F16>(), frames })
    })
}

/// The packets that a puppet's servos get while it plays a clip once, one a tick.
///
/// # Errors
/// Where clip and map do not fit together.
pub fn ticks(clip: &Clip<'_>, map: &Map) -> Result<Expected> {
    clip.decode(|decoder| {
        let show = Show { playlist: &[0], after: After::Hold, ..Show::default() };
        let mut machine = Machine::new(map, SingleClip::new(decoder, None), show, Start::Power);
        let mut rehearsal = IdealServos::new(&machine);
        let mut packet = [0; goal_positions_len(MAX_SERVOS)];
        let mut frames = Vec::new();
        if !rehearsal.until_it_plays(&mut machine, PATIENCE) {
            bail!(
                "the clip does not come to play on this puppet: {:?}, {:?}",
                machine.state(),
                machine.fault()
            );
        }
        while machine.state() == State::Playing {
            let goals = rehearsal.tick(&mut machine);
            frames.push(goal_positions(&mut packet, goals)?.to_vec());
        }
        Ok(Expected { element: 1, frames })
    })
}

/// Ticks that a puppet has to get to its first pose: more than a minute at the highest rate.
const PATIENCE: u32 = 100_000;
