//! BVH files.

use crate::{Random, text};
use mocap::import::bvh;
use mocap::{Clip, export, sample};

/// Some frames of the embedded clip.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut clip = sample::clip();
    clip.motion.samples.truncate(4 * clip.motion.channels);
    let mut written = Vec::new();
    export::bvh::write(&mut written, &clip.skeleton, &clip.motion)
        .unwrap_or_else(|error| panic!("the sample: {error}"));
    let small = b"HIERARCHY\nROOT hip\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition \
        Zrotation Xrotation Yrotation\n JOINT knee\n {\n  OFFSET 0 -10 0\n  CHANNELS 3 Zrotation Xrotation \
        Yrotation\n  End Site\n  {\n   OFFSET 0 -9 1\n  }\n }\n}\nMOTION\nFrames: 2\nFrame Time: 0.0333333\n\
        0 1 2 3 4 5 6 7 8\n0.5 1 2 -3 4 5 6 7 9e-1\n";
    vec![small.to_vec(), written]
}

/// Reads a clip, poses its skeleton, writes and reads it again, and encodes it.
///
/// # Panics
/// Where reader or encoder does, or what they say is no sentence, or what is written is not read.
pub fn check(bytes: &[u8]) -> bool {
    let Clip { skeleton, motion } = match bvh::parse(bytes, "x.bvh", 1.0, None) {
        Ok(read) => read.clip,
        Err(error) => {
            text::check_sentence(&error);
            return false;
        }
    };
    text::check_skeleton(&skeleton);
    let mut written = Vec::new();
    if export::bvh::write(&mut written, &skeleton, &motion).is_ok() {
        let again = bvh::parse(&written, "x.bvh", 1.0, None)
            .unwrap_or_else(|error| panic!("written and read again: {error}"));
        assert_eq!(again.clip.motion.frames(), motion.frames());
    }
    text::check_motion(&skeleton, &motion, &mut Random::of(bytes));
    true
}
