//! What must hold for any text that is imported.

use encoder::mclip::{self, Encoder, Encoding, Quality};
use encoder::qmd::{self, Method, Parameters};
use mocap::import::ImportError;
use mocap::kinematics::Kinematics;
use mocap::{Clip, Motion, Skeleton};

use crate::Random;
use decoder_core::mclip::CodecId;

/// Most values of a motion that is encoded.
const MOST_VALUES: usize = 2_000;

/// An error is one sentence that names file, what was found and what was expected.
pub fn check_sentence(error: &ImportError) {
    let error = error.to_string();
    assert!(error.starts_with("x."), "{error}");
    assert!(error.contains(": found ") && error.contains(", expected "), "{error}");
    assert!(error.len() < 300 && !error.contains(['\n', '\r', '\0']), "{error}");
}

/// A skeleton can be posed.
pub fn check_skeleton(skeleton: &Skeleton) {
    let mut kinematics = Kinematics::new(skeleton);
    let pose = vec![1.0; kinematics.channels()];
    let mut positions = vec![[0.0; 3]; kinematics.joints()];
    kinematics.positions(&pose, &mut positions);
    assert_eq!(skeleton.joints.len(), positions.len());
}

/// A motion is encoded and decoded, or refused.
pub fn check_motion(skeleton: &Skeleton, motion: &Motion, random: &mut Random) {
    assert_eq!(motion.samples.len(), motion.frames() * motion.channels);
    assert!(motion.samples.iter().all(|value| value.is_finite()), "numbers are finite");
    if motion.samples.len() > MOST_VALUES {
        return;
    }
    let codec = CodecId::ALL[random.below(CodecId::ALL.len())];
    let bits = 1 + random.below(8) as u8;
    if let Ok(encoder) = Encoder::new(skeleton, motion) {
        let encoded = encoder.encode(&Encoding::new(codec), Quality::Bits(bits));
        let bytes = encoded.unwrap_or_else(|error| panic!("{codec:?}: {error}"));
        let decoded = mclip::decode(&bytes).unwrap_or_else(|error| panic!("{codec:?}: {error}"));
        assert_eq!(decoded.samples.len(), motion.samples.len(), "{codec:?}");
    }
    let clip = Clip { skeleton: skeleton.clone(), motion: motion.clone() };
    let parameters = Parameters { fixed_channels: random.below(3) as u16, ..Parameters::TABLE_1 };
    if let Ok(bytes) = qmd::encode(&clip, parameters, Method::ClosedLoop) {
        let decoded = qmd::decode(&bytes).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(decoded.samples.len(), motion.samples.len());
    }
}
