//! A clip: who moves, and how.

use crate::motion::Motion;
use crate::skeleton::Skeleton;

/// A skeleton and a motion of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// What moves.
    pub skeleton: Skeleton,
    /// How it moves: one column per channel of the skeleton.
    pub motion: Motion,
}
