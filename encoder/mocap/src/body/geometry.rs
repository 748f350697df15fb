//! Parts by lengths and symmetry, at rest.
//!
//! Two branches of a joint that are about as long, and have about as many joints, are a pair of limbs. The joint from
//! which one pair and a branch with another pair go out is the hips: that branch is the spine, its pair are the arms.
//! A limb's two longest bones in a row are upper arm and forearm, or thigh and shin.
//!
//! Left and right are told by where the feet point. Where the legs do not hang down at rest, figures are taken to face
//! along z, or along -y where z is up.

use super::part::{Part, Side};
use super::tree::{Tree, cross, dot, length, subtract, unit};
use crate::angles;

/// A branch that is shorter than this part of the figure's longest one is a finger or an ornament.
const LIMB: f64 = 0.25;

/// Two branches are a pair if the shorter has at least this part of the longer one's length, and of its joints.
const ALIKE: f64 = 0.75;

/// The joint of each part that geometry tells, in the order of [`Part::ALL`].
pub fn find(tree: &Tree) -> [Option<usize>; Part::ALL.len()] {
    let mut found = [None; Part::ALL.len()];
    if let Some(figure) = Figure::of(tree) {
        figure.name_parts(tree, &mut |part, joint| found[part.index()] = Some(joint));
    }
    found
}

/// A joint's lengths and what hangs on it.
struct Branches<'t> {
    tree: &'t Tree,
    /// For each joint the way from its parent to the farthest end below, in centimetres.
    reach: Vec<f64>,
    /// The number of joints from each joint down.
    count: Vec<usize>,
    longest: f64,
}

impl<'t> Branches<'t> {
    fn of(tree: &'t Tree) -> Self {
        let joints = tree.parents.len();
        let mut below: Vec<f64> = (0..joints).map(|joint| length(tree.bone(joint))).collect();
        let mut reach = vec![0.0; joints];
        let mut count = vec![1; joints];
        for joint in (0..joints).rev() {
            let Some(parent) = tree.parents[joint] else { continue };
            reach[joint] = below[joint] + length(subtract(tree.origins[joint], tree.origins[parent]));
            below[parent] = f64::max(below[parent], reach[joint]);
            count[parent] += count[joint];
        }
        Self { tree, reach, count, longest: below.first().copied().unwrap_or(0.0) }
    }

    /// The branches of a joint that are long enough for a limb, the longest first.
    fn limbs(&self, joint: usize) -> Vec<usize> {
        let long = |&&child: &&usize| self.reach[child] >= LIMB * self.longest;
        let mut limbs: Vec<usize> = self.tree.children[joint].iter().filter(long).copied().collect();
        limbs.sort_by(|&a, &b| self.reach[b].total_cmp(&self.reach[a]));
        limbs
    }

    /// The two limbs of a joint that are most alike, if they are a pair.
    fn pair(&self, joint: usize) -> Option<[usize; 2]> {
        let limbs = self.limbs(joint);
        let likeness = |a: usize, b: usize| {
            let lengths = self.reach[b] / self.reach[a];
            let (few, many) = (self.count[a].min(self.count[b]), self.count[a].max(self.count[b]));
            lengths.min(few as f64 / many as f64)
        };
        let pairs =
            limbs.iter().enumerate().flat_map(|(at, &a)| limbs[at + 1..].iter().map(move |&b| [a, b]));
        let best = pairs.max_by(|x, y| likeness(x[0], x[1]).total_cmp(&likeness(y[0], y[1])))?;
        (likeness(best[0], best[1]) >= ALIKE).then_some(best)
    }

    /// The nearest joint from `joint` down that has a pair of limbs.
    fn fork(&self, joint: usize) -> Option<(usize, [usize; 2])> {
        let mut waiting = std::collections::VecDeque::from([joint]);
        while let Some(joint) = waiting.pop_front() {
            if let Some(pair) = self.pair(joint) {
                return Some((joint, pair));
            }
            waiting.extend(self.limbs(joint));
        }
        None
    }

    /// The joints from `joint` on along the longest way; the ends of bones that are no joints are left out.
    fn chain(&self, joint: usize) -> Vec<usize> {
        let longest = |&joint: &usize| {
            let children = self.tree.children[joint].iter().copied();
            children.max_by(|&a, &b| self.reach[a].total_cmp(&self.reach[b]))
        };
        std::iter::successors(Some(joint), longest).filter(|&joint| !self.tree.only_ends[joint]).collect()
    }
}

struct Figure {
    hips: usize,
    chest: usize,
    legs: [Vec<usize>; 2],
    arms: [Vec<usize>; 2],
    /// From below the chest on.
    head: Vec<usize>,
}

impl Figure {
    fn of(tree: &Tree) -> Option<Self> {
        let branches = Branches::of(tree);
        // The highest joint from which both legs and arms go out.
        let forked = |joint: usize| -> Option<([usize; 2], usize, [usize; 2])> {
            let limbs = branches.limbs(joint);
            limbs.iter().find_map(|&spine| {
                let (chest, arms) = branches.fork(spine)?;
                let legs = match branches.pair(joint) {
                    Some(legs) if !legs.contains(&spine) => legs,
                    // The legs hang on a joint of their own.
                    _ => {
                        let pelvis = limbs.iter().copied().find(|&limb| limb != spine)?;
                        branches.fork(pelvis)?.1
                    }
                };
                Some((legs, chest, arms))
            })
        };
        let (hips, (legs, chest, arms)) =
            (0..tree.parents.len()).find_map(|joint| Some((joint, forked(joint)?)))?;
        let others = tree.children[chest].iter().copied().filter(|child| !arms.contains(child));
        let head = others.max_by(|&a, &b| branches.reach[a].total_cmp(&branches.reach[b]));
        Some(Self {
            hips,
            chest,
            legs: legs.map(|leg| branches.chain(leg)),
            arms: arms.map(|arm| branches.chain(arm)),
            head: head.map_or_else(Vec::new, |joint| branches.chain(joint)),
        })
    }

    fn name_parts(mut self, tree: &Tree, name: &mut impl FnMut(Part, usize)) {
        self.order_sides(tree);
        name(Part::Hips, self.hips);
        if let Some(&spine) = tree.path(self.hips, self.chest).first().filter(|&&spine| spine != self.chest) {
            name(Part::Spine, spine);
        }
        name(Part::Chest, self.chest);
        // The top of a head may be a joint of its own, without length.
        while self.head.len() > 2 && self.head.last().is_some_and(|&top| length(tree.bone(top)) == 0.0) {
            self.head.pop();
        }
        match self.head[..] {
            [] => {}
            [head] => name(Part::Head, head),
            [neck, .., head] => {
                name(Part::Neck, neck);
                name(Part::Head, head);
            }
        }
        for (side, (arm, leg)) in Side::BOTH.into_iter().zip(self.arms.iter().zip(&self.legs)) {
            let first = two_longest(tree, arm);
            if let Some(&clavicle) = first.checked_sub(1).and_then(|before| arm.get(before)) {
                name(Part::Clavicle(side), clavicle);
            }
            let parts = [Part::UpperArm(side), Part::Forearm(side), Part::Hand(side)];
            parts.into_iter().zip(&arm[first..]).for_each(|(part, &joint)| name(part, joint));
            let parts = [Part::Thigh(side), Part::Shin(side), Part::Foot(side), Part::Toes(side)];
            parts
                .into_iter()
                .zip(&leg[two_longest(tree, leg)..])
                .for_each(|(part, &joint)| name(part, joint));
        }
    }

    /// Puts the left limbs first.
    fn order_sides(&mut self, tree: &Tree) {
        let above = |joint: usize, path: &[usize]| {
            let ends = path.iter().map(|&end| subtract(tree.origins[end], tree.origins[joint]));
            ends.into_iter().find_map(unit)
        };
        let up = above(self.hips, &tree.path(self.hips, self.chest)).unwrap_or([0.0, 1.0, 0.0]);
        let left = unit(cross(up, self.forward(tree, up))).unwrap_or([1.0, 0.0, 0.0]);
        // The chest's own up may be another at rest, and its left with it.
        let up_of_chest = above(self.chest, &self.head).unwrap_or(up);
        let left_of_chest = angles::apply(&angles::least_turn(up, up_of_chest), left);
        for (limbs, left) in [(&mut self.legs, left), (&mut self.arms, left_of_chest)] {
            let [a, b] = &*limbs;
            let apart = a.iter().zip(b).map(|(&a, &b)| dot(subtract(tree.origins[a], tree.origins[b]), left));
            if apart.into_iter().find(|apart| apart.abs() > 1e-6).is_some_and(|apart| apart < 0.0) {
                limbs.swap(0, 1);
            }
        }
    }

    /// Where the feet point.
    fn forward(&self, tree: &Tree, up: [f64; 3]) -> [f64; 3] {
        let usual = if up[2].abs() > 0.7 { [0.0, -up[2].signum(), 0.0] } else { [0.0, 0.0, 1.0] };
        let leg = &self.legs[0];
        let first = two_longest(tree, leg);
        let [Some(&thigh), Some(&foot)] = [leg.get(first), leg.get(first + 2)] else { return usual };
        let hangs = unit(subtract(tree.origins[foot], tree.origins[thigh]));
        let points = unit(tree.bone(foot));
        match (hangs, points) {
            (Some(hangs), Some(points)) if dot(hangs, up) < -0.7 => {
                let rise = dot(points, up);
                let level: [f64; 3] = std::array::from_fn(|k| points[k] - rise * up[k]);
                if length(level) > 0.3 { level } else { usual }
            }
            _ => usual,
        }
    }
}

/// Where in a limb the two longest bones in a row begin.
fn two_longest(tree: &Tree, limb: &[usize]) -> usize {
    let bones: Vec<f64> =
        limb.windows(2).map(|pair| length(subtract(tree.origins[pair[1]], tree.origins[pair[0]]))).collect();
    let sums = bones.windows(2).map(|pair| pair[0] + pair[1]).enumerate();
    sums.fold((0, 0.0), |best, (at, sum)| if sum > best.1 { (at, sum) } else { best }).0
}
