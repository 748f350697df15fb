//! A skeleton at rest as a tree: children, places, and what hangs below what.

use crate::skeleton::Skeleton;

pub struct Tree {
    pub parents: Vec<Option<usize>>,
    pub children: Vec<Vec<usize>>,
    /// Where each joint turns, with all channels at 0, in centimetres.
    pub origins: Vec<[f64; 3]>,
    /// Whether each joint is none, but says where its parent's bone ends (an `End Site`).
    pub only_ends: Vec<bool>,
    /// Where each bone ends: its tail, and the joint itself where it has none.
    pub ends: Vec<[f64; 3]>,
}

impl Tree {
    pub fn of(skeleton: &Skeleton) -> Self {
        let joints = &skeleton.joints;
        let mut tree = Self {
            parents: joints.iter().map(|joint| joint.parent).collect(),
            children: vec![Vec::new(); joints.len()],
            origins: Vec::with_capacity(joints.len()),
            ends: Vec::with_capacity(joints.len()),
            only_ends: Vec::with_capacity(joints.len()),
        };
        for (index, joint) in joints.iter().enumerate() {
            let from = joint.parent.map_or([0.0; 3], |parent| tree.origins[parent]);
            let origin = add(from, joint.offset);
            tree.origins.push(origin);
            tree.ends.push(add(origin, joint.tail));
            if let Some(parent) = joint.parent {
                tree.children[parent].push(index);
            }
        }
        tree.only_ends = (joints.iter().zip(&tree.children))
            .map(|(joint, children)| {
                joint.channels.is_empty() && children.is_empty() && joint.tail == [0.0; 3]
            })
            .collect();
        tree
    }

    /// The joint, its parent, and so on up to the root.
    pub fn up_from(&self, joint: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(joint), |&joint| self.parents[joint])
    }

    /// Whether `joint` is `above`, or hangs below it.
    pub fn is_below(&self, joint: usize, above: usize) -> bool {
        self.up_from(joint).any(|joint| joint == above)
    }

    /// The lowest joint that both hang on.
    pub fn common(&self, a: usize, b: usize) -> usize {
        self.up_from(a).find(|&joint| self.is_below(b, joint)).unwrap_or(0)
    }

    /// The joints from below `above` down to `joint` itself; nothing if `joint` does not hang below it.
    pub fn path(&self, above: usize, joint: usize) -> Vec<usize> {
        if !self.is_below(joint, above) {
            return Vec::new();
        }
        let mut path: Vec<usize> = self.up_from(joint).take_while(|&joint| joint != above).collect();
        path.reverse();
        path
    }

    /// From the joint to the end of its bone at rest: its tail, else the mean of what hangs on it.
    pub fn bone(&self, joint: usize) -> [f64; 3] {
        let tail = subtract(self.ends[joint], self.origins[joint]);
        let children = &self.children[joint];
        if length(tail) > 0.0 || children.is_empty() {
            return tail;
        }
        let offsets = children.iter().map(|&child| subtract(self.origins[child], self.origins[joint]));
        offsets.fold([0.0; 3], add).map(|part| part / children.len() as f64)
    }
}

pub fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

pub fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

pub fn length(vector: [f64; 3]) -> f64 {
    dot(vector, vector).sqrt()
}

/// The direction of a vector; nothing if it has no length to speak of.
pub fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let length = length(vector);
    (length > 1e-9).then(|| vector.map(|part| part / length))
}
