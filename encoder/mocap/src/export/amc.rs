//! AMC (Acclaim motion): what [`import::amc`](crate::import::amc) reads.

use std::io::Write;

use super::error::{ExportError, check_channels};
use super::number::write_number;
use crate::angles;
use crate::motion::Motion;
use crate::skeleton::Origin;
use crate::skeleton::Skeleton;

/// Rotations as an AMC file gets them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rotations {
    /// As they are: what was read from an AMC file is written back digit by digit.
    AsTheyAre,
    /// Brought into (-180, 180] degrees, which other programs expect: for motions with continuous angles.
    Wrapped,
}

/// Writes a motion of an ASF skeleton, in degrees and in the ASF file's unit of length.
///
/// The rate is written as `:SAMPLES-PER-SECOND`, which this crate reads and others skip.
///
/// # Errors
/// A skeleton that is not from an ASF file, a motion that does not fit it, an output that fails.
pub fn write(
    out: &mut impl Write,
    skeleton: &Skeleton,
    motion: &Motion,
    rotations: Rotations,
) -> Result<(), ExportError> {
    check_channels(skeleton, motion)?;
    let Origin::Asf { cm_per_unit, .. } = skeleton.origin else {
        return Err(ExportError::Unsupported {
            format: "AMC",
            what: "a motion of another skeleton".to_string(),
            expected: "one of an ASF skeleton; BVH, GLB, CSV and JSON can hold it",
        });
    };
    write!(out, "#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n")?;
    // By bone in the order of the channels: the order of the file that it came from, at least in CMU's files.
    let mut bones: Vec<_> = skeleton.joints.iter().filter(|joint| !joint.channels.is_empty()).collect();
    bones.sort_by_key(|joint| joint.channels.start);
    for (frame, pose) in motion.iter().enumerate() {
        writeln!(out, "{}", frame + 1)?;
        for bone in &bones {
            write!(out, "{}", bone.name)?;
            for channel in bone.channels.clone() {
                let value = pose[channel];
                let value = match (skeleton.channels[channel].dof.is_rotation(), rotations) {
                    (false, _) => value / cm_per_unit,
                    (true, Rotations::AsTheyAre) => value,
                    (true, Rotations::Wrapped) => angles::wrap(value),
                };
                out.write_all(b" ")?;
                write_number(out, value)?;
            }
            out.write_all(b"\n")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Clip;
    use crate::import::{amc, bvh};
    use crate::sample;

    fn written(skeleton: &Skeleton, motion: &Motion, rotations: Rotations) -> Result<String, ExportError> {
        let mut out = Vec::new();
        write(&mut out, skeleton, motion, rotations)?;
        Ok(String::from_utf8(out).expect("text"))
    }

    #[test]
    fn what_is_written_is_read_again() {
        let clip = sample::clip();
        let text = written(&clip.skeleton, &clip.motion, Rotations::AsTheyAre).expect("an ASF skeleton");
        let again = amc::parse(text.as_bytes(), "x.amc", &clip.skeleton, Some(sample::FPS));
        assert_eq!(again.expect("our own text"), clip.motion);
    }

    #[test]
    fn continuous_angles_are_wrapped_if_asked_for() {
        let clip = sample::clip();
        let mut motion = clip.motion.clone();
        let turning = clip.skeleton.channel("root.ry").expect("a channel of the puppet");
        motion.samples.iter_mut().skip(turning).step_by(motion.channels).for_each(|value| *value += 720.0);
        let read = |rotations| {
            let text = written(&clip.skeleton, &motion, rotations).expect("an ASF skeleton");
            amc::parse(text.as_bytes(), "x.amc", &clip.skeleton, None).expect("our own text").frame(100)
                [turning]
        };
        assert_eq!(read(Rotations::AsTheyAre), motion.frame(100)[turning]);
        assert!((read(Rotations::Wrapped) - clip.motion.frame(100)[turning]).abs() < 1e-12);
    }

    #[test]
    fn bvh_skeletons_are_refused() {
        let text = b"HIERARCHY ROOT a\n{ OFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 1\nFrame Time: 1\n5\n";
        let Clip { skeleton, motion } = bvh::parse(text, "x.bvh", 1.0, None).expect("a clip").clip;
        let error =
            written(&skeleton, &motion, Rotations::AsTheyAre).expect_err("a BVH skeleton").to_string();
        assert_eq!(
            error,
            "AMC cannot hold a motion of another skeleton, expected one of an ASF skeleton; BVH, GLB, CSV and JSON can hold it"
        );
        let error =
            written(&sample::clip().skeleton, &motion, Rotations::Wrapped).expect_err("another skeleton");
        assert_eq!(error.to_string(), "the motion has 1 channels, expected 31 as in the skeleton");
    }
}
