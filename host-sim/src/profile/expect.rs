//! What an image is to give: the same as this machine.

use super::measure::Expected;
use crate::clip::Clip;
use crate::puppet::Map;
use anyhow::Result;
use decoder_core::I16F16;
use firmware::drive::buffer_len;
use firmware::dynamixel::sync_write::goal_positions;
use firmware::map::MAX_SERVOS;
use firmware::player::{Player, Repeat};

/// The frames of a clip.
///
/// # Errors
/// Those of its decoder.
pub fn frames(clip: &Clip<'_>) -> Result<Expected> {
    clip.decode(|decoder| {
        let mut frames = Vec::new();
        while let Some(frame) = decoder.next_frame() {
            frames.push(frame.iter().flat_map(|value| value.to_le_bytes()).collect());
        }
        Ok(Expected { element: size_of::<I16F16>(), frames })
    })
}

/// The packets that a puppet's servos get, one a tick.
///
/// # Errors
/// Where clip and map do not fit together.
pub fn ticks(clip: &Clip<'_>, map: &Map) -> Result<Expected> {
    clip.decode(|decoder| {
        let mut player = Player::new(decoder, clip.rate_centihertz(), map, Repeat::Once)?;
        let mut packet = [0; buffer_len(MAX_SERVOS)];
        let mut frames = Vec::new();
        while let Some(goals) = player.tick() {
            frames.push(goal_positions(&mut packet, goals)?.to_vec());
        }
        Ok(Expected { element: 1, frames })
    })
}
