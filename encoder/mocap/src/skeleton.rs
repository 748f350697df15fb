//! A skeleton: a tree of joints and the channels that move them.

use std::ops::Range;

/// A degree of freedom: what a channel moves, and along or about which axis of its joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dof {
    /// Translation along x, in centimetres.
    Tx,
    /// Translation along y, in centimetres.
    Ty,
    /// Translation along z, in centimetres.
    Tz,
    /// Rotation about x, in degrees.
    Rx,
    /// Rotation about y, in degrees.
    Ry,
    /// Rotation about z, in degrees.
    Rz,
    /// Length of the bone beyond its rest length, in centimetres (ASF `l`).
    Length,
}

impl Dof {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::Tx, Self::Ty, Self::Tz, Self::Rx, Self::Ry, Self::Rz, Self::Length];

    /// Its name in an ASF file, in lower case: `tx`, `rz`, `l`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
            Self::Length => "l",
        }
    }

    /// Whether it is a rotation, in degrees; the others are lengths, in centimetres.
    pub const fn is_rotation(self) -> bool {
        matches!(self, Self::Rx | Self::Ry | Self::Rz)
    }

    /// 0, 1 or 2 for a rotation about, or a translation along, x, y or z; `None` for [`Length`](Self::Length).
    pub const fn axis(self) -> Option<usize> {
        match self {
            Self::Tx | Self::Rx => Some(0),
            Self::Ty | Self::Ry => Some(1),
            Self::Tz | Self::Rz => Some(2),
            Self::Length => None,
        }
    }
}

/// One degree of freedom: a column of a [`Motion`](crate::motion::Motion).
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `joint.dof`, for instance `rradius.rx`.
    pub name: String,
    /// What it moves.
    pub dof: Dof,
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

impl Joint {
    /// Its rotations in the order in which they multiply, if there are three and each is about another axis.
    pub fn euler_triple(&self, skeleton: &Skeleton) -> Option<[usize; 3]> {
        let triple = <[usize; 3]>::try_from(self.rotations.as_slice()).ok()?;
        let axes = triple.map(|channel| skeleton.channels[channel].dof.axis());
        (axes[0] != axes[1] && axes[1] != axes[2] && axes[0] != axes[2]).then_some(triple)
    }
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
    /// The columns of a table or of a move: joints side by side, whose bones are made up.
    Table,
    /// The hierarchy of a BVH file.
    Bvh {
        /// Centimetres in one of the file's units of length.
        cm_per_unit: f64,
    },
}

impl Origin {
    /// Centimetres in one of the file's units of length.
    pub const fn cm_per_unit(self) -> f64 {
        match self {
            Self::Asf { cm_per_unit, .. } | Self::Bvh { cm_per_unit } => cm_per_unit,
            Self::Table => 1.0,
        }
    }
}

impl Skeleton {
    /// Hierarchy level of every channel: the level of its joint.
    pub fn channel_levels(&self) -> Vec<u8> {
        self.channels.iter().map(|channel| self.joints[channel.joint].level).collect()
    }

    /// Whether each channel is a rotation, in degrees (the others are lengths, in centimetres).
    pub fn rotation_channels(&self) -> Vec<bool> {
        self.channels.iter().map(|channel| channel.dof.is_rotation()).collect()
    }

    /// A number that says whose bones these are, as 16 hexadecimal digits: the same for all recordings of a figure at rest
    /// in one way, in whatever unit, and another for other names, lengths and rest poses.
    ///
    /// Lengths count to about a hundredth of the longest bone. Where the root is does not count.
    pub fn fingerprint(&self) -> String {
        let size = |vector: &[f64; 3]| vector.iter().map(|part| part * part).sum::<f64>().sqrt();
        let below = self.joints.iter().filter(|joint| joint.parent.is_some());
        let lengths = below.flat_map(|joint| [size(&joint.offset), size(&joint.tail)]);
        let longest = lengths.fold(f64::MIN_POSITIVE, f64::max);
        // An odd factor, so that lengths in whole numbers are not on the edge between two.
        let part = |value: f64| ((value * 97.31 + 0.1234).round() as i64).to_le_bytes();
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut take = |bytes: &[u8]| {
            for byte in bytes {
                hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        for joint in &self.joints {
            take(joint.name.as_bytes());
            take(b"\0");
            take(&(joint.parent.map_or(-1, |parent| parent as i64)).to_le_bytes());
            joint.axis.as_flattened().iter().for_each(|value| take(&part(*value)));
            joint.tail.iter().for_each(|value| take(&part(value / longest)));
            if joint.parent.is_some() {
                joint.offset.iter().for_each(|value| take(&part(value / longest)));
            }
        }
        format!("{hash:016x}")
    }

    /// Index of the channel of that name, for instance `rradius.rx`.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel.name == name)
    }

    /// The same joints with these channels alone, in this order: column `i` of its motions is column `kept[i]` of this one's.
    /// What is left out is at rest.
    ///
    /// # Panics
    /// If there is no such channel, one is named twice, or those of a joint do not follow each other.
    #[must_use]
    pub fn with_channels(&self, kept: &[usize]) -> Self {
        let channels: Vec<Channel> = kept.iter().map(|&channel| self.channels[channel].clone()).collect();
        let place = |channel: usize| kept.iter().position(|&other| other == channel);
        let mut joints = self.joints.clone();
        for (index, joint) in joints.iter_mut().enumerate() {
            joint.rotations = joint.rotations.iter().filter_map(|&channel| place(channel)).collect();
            let own = |channel: &Channel| channel.joint == index;
            let start = channels.iter().position(own).unwrap_or(0);
            let count = channels.iter().filter(|channel| own(channel)).count();
            joint.channels = start..start + count;
            assert!(channels[joint.channels.clone()].iter().all(own), "channels of {} apart", joint.name);
        }
        let once = |(index, channel)| place(channel) == Some(index);
        assert!(kept.iter().copied().enumerate().all(once), "a channel twice");
        Self { joints, channels, origin: self.origin }
    }
}

#[cfg(test)]
mod tests {
    use crate::kinematics::Kinematics;
    use crate::sample;

    #[test]
    fn a_fingerprint_is_of_the_bones_and_not_of_the_unit() {
        let clip = sample::clip();
        let own = clip.skeleton.fingerprint();
        assert_eq!(own.len(), 16);
        for cm in [0.1, 2.54, 100.0] {
            let mut other = clip.clone();
            crate::import::unit::scale(&mut other, cm);
            other.skeleton.joints[0].offset = [1.0, 2.0, 3.0];
            assert_eq!(other.skeleton.fingerprint(), own);
        }
        let mut longer = clip.skeleton.clone();
        longer.joints[5].offset[1] += 2.0;
        let mut turned = clip.skeleton.clone();
        turned.joints[5].axis = crate::angles::rotation(0, 5.0);
        let mut named = clip.skeleton;
        named.joints[5].name.push('x');
        for other in [longer, turned, named] {
            assert_ne!(other.fingerprint(), own);
        }
    }

    #[test]
    fn with_fewer_channels_the_others_are_at_rest() {
        let clip = sample::clip();
        let kept = ["root.ty", "lradius.rx", "root.ry"];
        let kept = kept.map(|name| clip.skeleton.channel(name).expect("a channel of the sample"));
        // The root's together, though not in the skeleton's order.
        let kept = [kept[1], kept[2], kept[0]];
        let fewer = clip.skeleton.with_channels(&kept);
        let motion = clip.motion.with_channels(&kept);
        assert_eq!(fewer.channels.len(), 3);
        assert_eq!(fewer.channel("root.ty"), Some(2));
        let mut whole = Kinematics::new(&clip.skeleton);
        let mut part = Kinematics::new(&fewer);
        let mut expected = vec![[0.0; 3]; whole.joints()];
        let mut found = expected.clone();
        for (row, small) in clip.motion.iter().zip(motion.iter()) {
            let mut pose = vec![0.0; row.len()];
            kept.iter().zip(small).for_each(|(&channel, &value)| pose[channel] = value);
            assert_eq!(kept.map(|channel| row[channel]), *small);
            whole.positions(&pose, &mut expected);
            part.positions(small, &mut found);
            assert_eq!(found, expected);
        }
    }

    #[test]
    #[should_panic(expected = "channels of root apart")]
    fn channels_of_a_joint_stay_together() {
        let skeleton = sample::clip().skeleton;
        let kept = ["root.ty", "lradius.rx", "root.ry"];
        let _ = skeleton.with_channels(&kept.map(|name| skeleton.channel(name).unwrap_or(usize::MAX)));
    }
}
