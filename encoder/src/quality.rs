//! How fine a clip is.

/// How fine steps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality<'s> {
    /// Every channel has codes of so many bits, from 1 to [`Encode::most_bits`](crate::codec::encode::Encode::most_bits), and
    /// its best step.
    Bits(u8),
    /// The displacement in cm, root of the sum of squares over the joints, that one step of a channel makes. For
    /// codecs with [free steps](crate::codec::encode::Encode::has_free_steps).
    Step(f64),
    /// The step of every channel in its own unit, degrees or centimetres: what has the most PSNR for its bits. For the
    /// same codecs.
    Even(f64),
    /// The step of every channel in its own unit, one for each channel. For the same codecs.
    Each(&'s [f64]),
}
