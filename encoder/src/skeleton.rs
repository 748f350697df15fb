//! A skeleton: a tree of joints and the channels that move them.

pub use decoder_core::mclip::ChannelKind;
use std::ops::Range;

/// One degree of freedom: a column of a [`Motion`](crate::Motion).
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `joint.kind`, for instance `rradius.rx`.
    pub name: String,
    /// What it moves.
    pub kind: ChannelKind,
    /// Index of the joint that it belongs to.
    pub joint: usize,
    /// Lowest and highest value that the skeleton file names, if it does.
    pub limits: Option<(f64, f64)>,
}

/// A joint and the bone behind it.
///
/// Its transform is `M = M_parent · T(offset) · C · T(translations) · R · C⁻¹` with `C` the rest orientation
/// `axis` and `R` the product of its rotations; its position is that of `M · tail`. A `Length` channel moves
/// the tail, and with it the children, along the bone.
///
/// ASF: `offset` is the parent's tail (`:root position` for the root), `tail` is direction × length.
/// BVH: `offset` is OFFSET, but zero along an axis that has a position channel, since that replaces it;
/// `tail` is zero and `axis` the identity. An `End Site` is a joint without channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique in the skeleton.
    pub name: String,
    /// Index of the parent, which is smaller than the joint's own; `None` for the root, which is joint 0.
    pub parent: Option<usize>,
    /// Translation from the parent's origin to this joint's, in centimetres, in the parent's rest axes.
    pub offset: [f64; 3],
    /// Rest orientation of the joint's own axes, row-major.
    pub axis: [[f64; 3]; 3],
    /// From the joint's origin to the point that it is measured at (the bone's end), in centimetres.
    pub tail: [f64; 3],
    /// Its channels, in file order.
    pub channels: Range<usize>,
    /// Order in which the rotations multiply, left to right, as indices into the skeleton's channels.
    pub rotations: Vec<usize>,
    /// Hierarchy level (QMD 3.2): 1 for the root; a joint with channels is one above the nearest ancestor
    /// that has some.
    pub level: u8,
}

/// A tree of joints in an order where parents come first, and the columns that move it.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// Joints; the root is the first.
    pub joints: Vec<Joint>,
    /// Channels, the columns of a motion: the root's, then the joints' in the file's order.
    pub channels: Vec<Channel>,
    /// The format that it was read from and its unit of length: what an exporter writes back.
    pub origin: Origin,
}

/// Where a skeleton came from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// An Acclaim skeleton (ASF).
    Asf {
        /// Centimetres in one of the file's units of length: 2.54 / `length` of its `:units`.
        cm_per_unit: f64,
        /// Whether its motions are in radians unless they say otherwise.
        radians: bool,
    },
    /// The hierarchy of a BVH file.
    Bvh {
        /// Centimetres in one of the file's units of length.
        cm_per_unit: f64,
    },
}

impl Skeleton {
    /// Hierarchy level of every channel: the level of its joint.
    pub fn channel_levels(&self) -> Vec<u8> {
        self.channels.iter().map(|channel| self.joints[channel.joint].level).collect()
    }

    /// Whether each channel is a rotation, in degrees (the others are lengths, in centimetres).
    pub fn rotation_channels(&self) -> Vec<bool> {
        self.channels.iter().map(|channel| channel.kind.is_rotation()).collect()
    }

    /// Index of the channel of that name, for instance `rradius.rx`.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel.name == name)
    }
}
