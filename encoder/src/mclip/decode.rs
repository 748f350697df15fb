//! Decodes a clip on the host.

use crate::memory::OwnedMemory;
use decoder_core::Limits;
use decoder_core::mclip::Clip;
use mocap::motion::Motion;

/// Decodes a whole clip with the decoder's own code. Values are in degrees and centimetres, angles continuous.
///
/// # Errors
/// As [`Clip::parse`] and [`Decoder::next_frame`](decoder_core::mclip::Decoder::next_frame).
pub fn decode(bytes: &[u8]) -> Result<Motion, decoder_core::Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    let fields = clip.header().fields();
    let fps = f64::from(fields.rate_numerator) / f64::from(fields.rate_denominator);
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = clip.decoder(memory.lend())?;
    let mut samples = Vec::new();
    while let Some(pose) = decoder.next_frame()? {
        samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
    }
    Ok(Motion { fps, channels: clip.channels(), samples })
}
