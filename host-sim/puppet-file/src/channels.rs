//! The channels that a puppet's clips have: a column of their frames each.

use core::fmt;
use mocap::skeleton::{Dof, Skeleton};
use std::collections::BTreeSet;

/// What has the channels, for what is told of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// A skeleton.
    Skeleton,
    /// A clip that names its channels.
    Clip,
    /// A puppet: the channels of the clips that are made for it, one for each joint.
    Puppet,
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Skeleton => "the skeleton",
            Self::Clip => "the clip",
            Self::Puppet => "the puppet",
        })
    }
}

/// The unit of a channel's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Of a rotation: the degree.
    Degree,
    /// Of a translation and a bone's length: the centimetre.
    Centimetre,
}

impl Unit {
    /// The unit of rotations, or of all else.
    #[must_use]
    pub const fn of(is_rotation: bool) -> Self {
        if is_rotation { Self::Degree } else { Self::Centimetre }
    }

    /// What stands behind a number: `°` or `cm`.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Degree => "°",
            Self::Centimetre => "cm",
        }
    }
}

impl From<Dof> for Unit {
    fn from(dof: Dof) -> Self {
        Self::of(dof.is_rotation())
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Degree => "degree",
            Self::Centimetre => "cm",
        })
    }
}

/// The channels of a frame, in order, by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    owner: Owner,
    columns: Vec<(String, Unit)>,
    /// Joints without channels.
    still: Vec<String>,
}

impl From<&Skeleton> for Channels {
    fn from(skeleton: &Skeleton) -> Self {
        let still = skeleton.joints.iter().filter(|joint| joint.channels.is_empty());
        Self {
            owner: Owner::Skeleton,
            columns: skeleton
                .channels
                .iter()
                .map(|channel| (channel.name.clone(), channel.dof.into()))
                .collect(),
            still: still.map(|joint| joint.name.clone()).collect(),
        }
    }
}

impl Channels {
    /// Channels of these names, `joint.dof` each (`rradius.rx`), in the order of a frame's columns.
    pub fn new(owner: Owner, columns: impl IntoIterator<Item = (String, Unit)>) -> Self {
        Self { owner, columns: columns.into_iter().collect(), still: Vec::new() }
    }

    /// What has them.
    #[must_use]
    pub const fn owner(&self) -> Owner {
        self.owner
    }

    /// Whether they can be those of a clip that was made for a puppet: one channel a joint, a rotation about x or a
    /// translation along x.
    pub(crate) fn may_be_fitted(&self) -> bool {
        let mut joints = BTreeSet::new();
        let fits = |name: &str| name.ends_with(".rx") || name.ends_with(".tx");
        self.names().all(|name| fits(name) && joints.insert(joint_of(name)))
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The name of a column; empty for one that there is not.
    #[must_use]
    pub fn name(&self, index: usize) -> &str {
        self.columns.get(index).map_or("", |(name, _)| name)
    }

    /// Their names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    /// The digest of their names that a device compares a clip's with (docs/MAP.md); 0 where nothing has a name.
    pub fn names_digest(&self) -> u32 {
        let mut digest = decoder_core::mclip::digest();
        for name in self.names() {
            digest.update(name.as_bytes());
            digest.update(b"\n");
        }
        if self.columns.is_empty() { 0 } else { digest.finalize() }
    }

    /// The column of a channel, and the unit of its values.
    ///
    /// # Errors
    /// [`MissingChannel`], which says what there is instead.
    pub fn find(&self, name: &str) -> Result<(usize, Unit), MissingChannel> {
        let found = self.columns.iter().enumerate().find(|(_, (own, _))| own == name);
        found.map(|(index, &(_, unit))| (index, unit)).ok_or_else(|| self.missing(name))
    }

    fn missing(&self, name: &str) -> MissingChannel {
        let (channel, joint, owner) = (name.to_owned(), joint_of(name), self.owner);
        if self.still.iter().any(|still| still == joint) {
            return MissingChannel::OfStillJoint { channel, joint: joint.to_owned(), owner };
        }
        let own: Vec<String> =
            self.names().filter(|own| joint_of(own) == joint).map(ToOwned::to_owned).collect();
        if !own.is_empty() {
            return MissingChannel::OfMovingJoint { channel, own, owner };
        }
        let mut near: Vec<_> = self.names().map(|own| (strsim::levenshtein(name, own), own)).collect();
        near.sort_unstable();
        let nearest = near.into_iter().take(3).map(|(_, name)| name.to_owned()).collect();
        MissingChannel::OfNoJoint { joint: joint.to_owned(), nearest, owner }
    }
}

/// The channel of a name is not there.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MissingChannel {
    /// There is no joint with that name.
    #[error("{owner} has no joint \"{joint}\"; the nearest channels are {}", .nearest.join(", "))]
    OfNoJoint {
        /// Name of the joint.
        joint: String,
        /// Channels with names that are like the channel's, at most three.
        nearest: Vec<String>,
        /// What lacks the channel.
        owner: Owner,
    },
    /// The joint has other channels.
    #[error("\"{channel}\" is no channel of {owner}; its joint has {}", .own.join(", "))]
    OfMovingJoint {
        /// Name of the channel.
        channel: String,
        /// The joint's channels.
        own: Vec<String>,
        /// What lacks the channel.
        owner: Owner,
    },
    /// The joint has no channels at all.
    #[error("\"{channel}\" is no channel: {owner}'s joint \"{joint}\" does not move")]
    OfStillJoint {
        /// Name of the channel.
        channel: String,
        /// Name of the joint.
        joint: String,
        /// What lacks the channel.
        owner: Owner,
    },
}

/// The joint of a channel: what stands before the last dot of the channel's name.
pub(crate) fn joint_of(channel: &str) -> &str {
    channel.rsplit_once('.').map_or(channel, |(joint, _)| joint)
}
