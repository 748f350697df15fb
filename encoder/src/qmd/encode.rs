//! A motion into a clip, and a clip into a motion.

use super::parameters::{Method, Parameters};
use super::{closed_loop, faithful, writer};
use crate::error::EncodeError;
use crate::source::Source;
use decoder_core::qmd::Clip;
use decoder_core::{I16F16, Limits};
use mocap::motion::Motion;

impl Source {
    /// Encodes as a .qmd with these parameters.
    ///
    /// # Errors
    /// [`EncodeError`] where the parameters do not fit the format.
    pub fn encode(&self, parameters: Parameters, method: Method) -> Result<Vec<u8>, EncodeError> {
        parameters.check(self.channels as u16)?;
        let coded = match method {
            Method::Faithful { exponent } => faithful::encode(self, parameters, exponent),
            Method::ClosedLoop => closed_loop::encode(self, parameters),
        };
        Ok(writer::write(self, parameters, &coded))
    }
}

/// Encodes a motion. To encode one motion many times, keep a [`Source`] and call [`Source::encode`].
///
/// # Errors
/// [`EncodeError`] where the parameters or the motion do not fit the format.
pub fn encode(clip: &mocap::Clip, parameters: Parameters, method: Method) -> Result<Vec<u8>, EncodeError> {
    Source::new(&clip.skeleton, &clip.motion)?.encode(parameters, method)
}

/// Decodes a whole clip with the decoder's own code. Values are in degrees and centimetres, angles continuous.
/// Where the clip has no rate, that of the motion is 0.
///
/// # Errors
/// As [`Clip::parse`].
pub fn decode(bytes: &[u8]) -> Result<Motion, decoder_core::Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    let mut pose = vec![I16F16::ZERO; clip.channels()];
    let mut table = vec![0; clip.table_len()];
    let mut decoder = clip.decoder(&mut pose, Some(&mut table))?;
    let mut samples = Vec::with_capacity(clip.frames() as usize * clip.channels());
    while let Some(pose) = decoder.next_frame() {
        samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
    }
    Ok(Motion { fps: f64::from(clip.rate_centihertz()) / 100.0, channels: clip.channels(), samples })
}
