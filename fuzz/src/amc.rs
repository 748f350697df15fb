//! AMC motions, of the embedded skeleton.

use crate::{Random, text};
use mocap::import::amc;
use mocap::{Clip, export, sample};
use std::sync::LazyLock;

static SAMPLE: LazyLock<Clip> = LazyLock::new(sample::clip);

/// Some frames of the embedded motion.
pub fn seeds() -> Vec<Vec<u8>> {
    let Clip { skeleton, motion } = &*SAMPLE;
    let some = |frames: usize| {
        let samples = motion.samples[..frames * motion.channels].to_vec();
        written(&mocap::Motion { samples, ..motion.clone() }, skeleton)
    };
    vec![some(1), some(8)]
}

fn written(motion: &mocap::Motion, skeleton: &mocap::Skeleton) -> Vec<u8> {
    let mut text = Vec::new();
    export::amc::write(&mut text, skeleton, motion, export::amc::Rotations::AsTheyAre)
        .unwrap_or_else(|error| panic!("a motion that was read: {error}"));
    text
}

/// Reads a motion, writes and reads it again, and encodes it.
///
/// # Panics
/// Where reader or encoder does, or what they say is no sentence, or what is written is not read.
pub fn check(bytes: &[u8]) -> bool {
    let skeleton = &SAMPLE.skeleton;
    let motion = match amc::parse(bytes, "x.amc", skeleton, None) {
        Ok(motion) => motion,
        Err(error) => {
            text::check_sentence(&error);
            return false;
        }
    };
    let again = amc::parse(&written(&motion, skeleton), "x.amc", skeleton, None);
    let again = again.unwrap_or_else(|error| panic!("written and read again: {error}"));
    assert_eq!(again.frames(), motion.frames());
    text::check_motion(skeleton, &motion, &mut Random::of(bytes));
    true
}
