//! AMC (Acclaim motion): what [`import::amc`](crate::import::amc) reads.

use std::io::Write;

use super::{ExportError, check_channels, write_number};
use crate::skeleton::Origin;
use crate::{Motion, Skeleton, angles};

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
            what: "a motion of a BVH skeleton".to_string(),
            expected: "one of an ASF skeleton; BVH and CSV can hold it",
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
                let value = match (skeleton.channels[channel].kind.is_rotation(), rotations) {
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
