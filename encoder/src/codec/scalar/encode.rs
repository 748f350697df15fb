//! Encodes a motion with a scalar codec.

use super::contract::ScalarEncode;
use super::simulate::Outline;
use super::write::write;
use crate::column::Choice;
use crate::error::EncodeError;
use crate::quality::Quality;
use crate::task::Task;
use decoder_core::entropy::fixed_width::GROUP;
use decoder_core::mclip::EntropyId;

/// The clip that a scalar codec makes of a motion: [`Encode::encode`](crate::codec::encode::Encode::encode).
///
/// # Errors
/// As that.
pub fn encode(
    codec: &dyn ScalarEncode,
    task: &Task<'_>,
    quality: Quality<'_>,
) -> Result<Vec<u8>, EncodeError> {
    let mut allocation = match quality {
        Quality::Bits(bits) => codec.allocate_bits(task, bits.clamp(1, codec.most_bits())),
        Quality::Step(cm) => codec.allocate_steps(task, &task.motion.steps(cm)),
        Quality::Even(step) => codec.allocate_steps(task, &vec![65536.0 * step; task.motion.columns.len()]),
        Quality::Each(steps) => {
            codec.allocate_steps(task, &steps.iter().map(|step| 65536.0 * step).collect::<Vec<f64>>())
        }
    }?;
    if task.entropy == Some(EntropyId::FixedWidth) {
        level(&mut allocation.choices);
    }
    let outline = Outline::of_clip(codec, task, &allocation);
    let coded = outline.simulate(&task.motion.source.targets, allocation.dead_zone)?;
    let stages = task.entropy.map_or(EntropyId::ALL.to_vec(), |entropy| vec![entropy]);
    let clips = stages.into_iter().map(|entropy| write(&outline, &coded, entropy, task.block_bytes));
    Ok(clips.min_by_key(Vec::len).unwrap_or_default())
}

/// Gives channels at rest codes too, where all others of their byte group have codes of one width: a decoder takes the codes
/// of equal groups several times as fast.
fn level(choices: &mut [Choice]) {
    for group in choices.chunks_mut(GROUP) {
        let width = group.iter().map(|choice| choice.bits).max().unwrap_or(0);
        if group.iter().all(|choice| choice.bits == 0 || choice.bits == width) {
            group.iter_mut().for_each(|choice| choice.bits = width);
        }
    }
}
