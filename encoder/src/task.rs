//! What a codec is to encode.

use crate::column::Column;
use crate::error::EncodeError;
use crate::source::Source;
use decoder_core::mclip::{ChannelKind, EntropyId};
use mocap::motion::Motion;
use mocap::skeleton::{Dof, Skeleton};

/// What a rotation counts for at least, in cm: as if it moved one point at this distance from its axis. A bone has a
/// girth, and a face or a hand at it, which joints do not show: by joints alone a head that turns about its neck, which
/// moves none, is off by 25 degrees.
pub const LEVER_CM: f64 = 10.0;

/// A motion by its channels, made ready to be encoded many times.
#[derive(Clone, Debug)]
pub struct Channels<'m> {
    /// Whose channels they are.
    pub skeleton: &'m Skeleton,
    /// The motion frame by frame.
    pub source: Source,
    /// The motion channel by channel.
    pub columns: Vec<Column>,
}

/// What a codec is to do.
#[derive(Clone, Copy, Debug)]
pub struct Task<'m> {
    /// The motion.
    pub motion: &'m Channels<'m>,
    /// The entropy stage; the smallest unless given.
    pub entropy: Option<EntropyId>,
    /// Longest block in bytes of codes; a frame that is longer has a block of its own.
    pub block_bytes: u16,
    /// Frames from one entry point to the next.
    pub entry_frames: usize,
}

impl<'m> Channels<'m> {
    /// # Errors
    /// [`EncodeError`] where the motion is empty or its size, rate or values do not fit the format.
    pub fn new(skeleton: &'m Skeleton, motion: &Motion) -> Result<Self, EncodeError> {
        let source = Source::new(skeleton, motion)?;
        if source.frames > i32::MAX as usize {
            let limit = i32::MAX as usize;
            return Err(EncodeError::TooMany { what: "frames", found: source.frames, limit });
        }
        let columns = Column::all(&source);
        Ok(Self { skeleton, source, columns })
    }

    /// The name of every channel's joint, and what it moves.
    pub fn labels(&self) -> impl Iterator<Item = (&str, ChannelKind)> {
        let channels = self.skeleton.channels.iter();
        channels.map(|channel| (self.skeleton.joints[channel.joint].name.as_str(), kind(channel.dof)))
    }

    /// The step of every channel in words, where a step moves the joints by `cm`; a rotation by no more than a point at
    /// [`LEVER_CM`].
    pub fn steps(&self, cm: f64) -> Vec<f64> {
        let least = (LEVER_CM * 1_f64.to_radians()).powi(2);
        let channels = self.source.weights.iter().zip(&self.skeleton.channels);
        let weights = channels
            .map(|(&weight, channel)| weight.max(if channel.dof.is_rotation() { least } else { 0.0 }));
        weights.map(|weight| 65536.0 * cm / weight.sqrt()).collect()
    }

    /// Sum over frames of the squared displacement of the joints, by how far each channel moves them.
    pub fn weighted_error(&self, decoded: &[i32]) -> f64 {
        let weights = self.source.weights.iter().cycle();
        let pairs = self.source.targets.iter().zip(decoded).zip(weights);
        pairs.map(|((a, b), weight)| weight * (f64::from(*a) - f64::from(*b)).powi(2)).sum()
    }
}

/// What a clip's header says of a channel.
const fn kind(dof: Dof) -> ChannelKind {
    match dof {
        Dof::Tx => ChannelKind::Tx,
        Dof::Ty => ChannelKind::Ty,
        Dof::Tz => ChannelKind::Tz,
        Dof::Rx => ChannelKind::Rx,
        Dof::Ry => ChannelKind::Ry,
        Dof::Rz => ChannelKind::Rz,
        Dof::Length => ChannelKind::Length,
    }
}
