//! JSON in the shape of the Blender Servo Animation add-on's export: what [`import::json`](crate::import::json) reads, and
//! scripts made for that add-on.

use std::io::{self, Write};

use serde_json::{Map, Value, json};

use super::error::{ExportError, check_channels};
use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// Writes one entry of `servos` for each channel, by its place: its name, its positions and their unit, `degrees` or `cm`.
///
/// The add-on itself writes positions in units of a servo, and no unit. `frames` and `seconds` are as there: the number
/// of frames, and the whole seconds of them.
///
/// # Errors
/// A motion that does not fit the skeleton, an output that fails.
pub fn write(out: &mut impl Write, skeleton: &Skeleton, motion: &Motion) -> Result<(), ExportError> {
    check_channels(skeleton, motion)?;
    let servos = skeleton.channels.iter().enumerate().map(|(index, channel)| {
        let positions: Vec<f64> = motion.iter().map(|row| row[index]).collect();
        let unit = if channel.dof.is_rotation() { "degrees" } else { "cm" };
        (index.to_string(), json!({ "name": channel.name, "unit": unit, "positions": positions }))
    });
    let animation = json!({
        "description": "Blender Servo Animation Positions",
        "fps": motion.fps,
        "frames": motion.frames(),
        "seconds": (motion.frames() as f64 / motion.fps).round() as u64,
        "bones": motion.channels,
        "servos": servos.collect::<Map<String, Value>>(),
    });
    serde_json::to_writer(&mut *out, &animation).map_err(io::Error::from)?;
    Ok(out.write_all(b"\n")?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{import, sample};

    #[test]
    fn what_is_written_is_read() {
        let clip = sample::clip();
        let mut out = Vec::new();
        write(&mut out, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        let read =
            import::json::parse(&out, "x.json", &import::Options::default()).expect("an animation").clip;
        assert_eq!((read.motion.fps, read.motion.frames()), (60.0, 480));
        for (index, channel) in clip.skeleton.channels.iter().enumerate() {
            let place = read.skeleton.channel(&channel.name).expect(&channel.name);
            assert!((0..480).all(|frame| read.motion.frame(frame)[place] == clip.motion.frame(frame)[index]));
        }
    }
}
