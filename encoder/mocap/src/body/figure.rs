//! Which joint of a skeleton is which part of the body.

use super::part::{Part, Side};
use super::tree::Tree;
use super::{geometry, names};
use crate::skeleton::{Origin, Skeleton};

/// How the joint of a part was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoundBy {
    /// By its name.
    Name,
    /// By what hangs on it: a bone of the spine or neck between parts that were found.
    Structure,
    /// By lengths and symmetry, because names say nothing.
    Geometry,
}

/// The joints of a skeleton that are parts of a body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    joints: [Option<(usize, FoundBy)>; Part::ALL.len()],
}

impl Body {
    /// Finds the parts: by the names of joints, then by structure, and by geometry what is then still missing.
    ///
    /// A part that the skeleton does not have, or that is not found, has no joint. Every joint is one part at most.
    pub fn of(skeleton: &Skeleton) -> Self {
        // Whose bones are made up has names of parts at most, and no T-pose.
        if skeleton.origin == Origin::Table {
            return Self { joints: [None; Part::ALL.len()] };
        }
        let tree = Tree::of(skeleton);
        let named = names::find(skeleton);
        let mut body = Self { joints: named.map(|joint| joint.map(|joint| (joint, FoundBy::Name))) };
        body.settle_middle(&tree);
        for (part, joint) in Part::ALL.into_iter().zip(geometry::find(&tree)) {
            if let Some(joint) = joint
                && body.joint(part).is_none()
                && body.part(joint).is_none()
            {
                body.joints[part.index()] = Some((joint, FoundBy::Geometry));
            }
        }
        body
    }

    /// The joint of a part, as an index into the skeleton's joints.
    pub fn joint(&self, part: Part) -> Option<usize> {
        self.joints[part.index()].map(|(joint, _)| joint)
    }

    /// How the joint of a part was found.
    pub fn found_by(&self, part: Part) -> Option<FoundBy> {
        self.joints[part.index()].map(|(_, found_by)| found_by)
    }

    /// The part that a joint is.
    pub fn part(&self, joint: usize) -> Option<Part> {
        Part::ALL.into_iter().find(|&part| self.joint(part) == Some(joint))
    }

    /// The joint of a plain name (`right forearm`), or of a joint's own name in the skeleton (`rradius`).
    ///
    /// The joint's own name goes first, since it says exactly which.
    pub fn find(&self, skeleton: &Skeleton, name: &str) -> Option<usize> {
        let own = skeleton.joints.iter().position(|joint| joint.name == name);
        own.or_else(|| self.joint(Part::parse(name)?))
    }

    /// Where arms and head are known, the spine is what lies between them and the hips.
    fn settle_middle(&mut self, tree: &Tree) {
        let of_side = |part: fn(Side) -> Part| {
            let joints = Side::BOTH.map(|side| self.joint(part(side)));
            let [Some(left), Some(right)] = joints else { return None };
            Some(tree.common(left, right))
        };
        let legs = of_side(Part::Thigh);
        let arms = of_side(Part::Clavicle).or_else(|| of_side(Part::UpperArm));
        // Where legs and spine go out below a joint of another name, the hips are that joint.
        if let (None, Some(legs)) = (self.joint(Part::Hips), legs) {
            self.set(Part::Hips, Some(legs));
        }
        // All of the body hangs on the hips, even where a joint of that name has legs alone.
        let above = arms.or_else(|| self.joint(Part::Spine)).or_else(|| self.joint(Part::Head));
        for limbs in [legs, above].into_iter().flatten() {
            if let Some(hips) = self.joint(Part::Hips) {
                let common = tree.common(hips, limbs);
                if tree.is_below(hips, common) && tree.is_below(limbs, common) {
                    self.set(Part::Hips, Some(common));
                }
            }
        }
        let Some(hips) = self.joint(Part::Hips) else { return };
        if let Some(chest) = arms.filter(|&chest| chest != hips && tree.is_below(chest, hips)) {
            let path = tree.path(hips, chest);
            self.set(Part::Spine, path.iter().copied().find(|&joint| joint != chest));
            self.set(Part::Chest, Some(chest));
        }
        if let (Some(chest), Some(head)) = (self.joint(Part::Chest), self.joint(Part::Head)) {
            let path = tree.path(chest, head);
            self.set(Part::Neck, path.iter().copied().find(|&joint| joint != head));
        }
    }

    /// A joint that its name had given already stays found by its name; one that was another part is that no more.
    fn set(&mut self, part: Part, joint: Option<usize>) {
        if self.joint(part) == joint {
            return;
        }
        if let Some(other) = joint.and_then(|joint| self.part(joint)) {
            self.joints[other.index()] = None;
        }
        self.joints[part.index()] = joint.map(|joint| (joint, FoundBy::Structure));
    }
}
