//! ASF skeletons.

use crate::text;
use mocap::import::asf;
use mocap::sample;

/// The embedded skeleton.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![sample::asf().into_bytes()]
}

/// Reads a skeleton, and poses it.
///
/// # Panics
/// Where the reader does, or what it says is no sentence.
pub fn check(bytes: &[u8]) -> bool {
    match asf::parse(bytes, "x.asf") {
        Ok(skeleton) => text::check_skeleton(&skeleton),
        Err(error) => {
            text::check_sentence(&error);
            return false;
        }
    }
    true
}
