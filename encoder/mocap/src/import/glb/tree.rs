//! The nodes that become joints, and where their channels come from.

use super::document::{CM_PER_METRE, Node, Wrong};
use super::keys::Track;
use crate::angles::{self, IDENTITY, Matrix};
use crate::import::names::Names;
use crate::quaternion;
use crate::skeleton::{Channel, Dof, Joint, Origin, Skeleton};

/// The parent of each node.
pub(super) fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>, Wrong> {
    let mut parents = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            match parents.get_mut(child) {
                Some(parent @ None) if child != index => *parent = Some(index),
                _ => return Err((format!("node {child} below node {index}"), "nodes that form trees")),
            }
        }
    }
    // Who has as many nodes above it as there are has itself among them. Each node is walked over once.
    let mut reaches_a_root = vec![false; nodes.len()];
    for first in 0..nodes.len() {
        let mut way = Vec::new();
        let mut next = Some(first);
        while let Some(node) = next.filter(|&node| !reaches_a_root[node]) {
            if way.len() == nodes.len() {
                return Err((format!("node {first} below itself"), "nodes that form trees"));
            }
            way.push(node);
            next = parents[node];
        }
        way.into_iter().for_each(|node| reaches_a_root[node] = true);
    }
    Ok(parents)
}

/// The nodes that become joints: each with its joint's parent and the scale of what is above it.
pub(super) struct Tree {
    nodes: Vec<Place>,
}

/// A node in the tree.
struct Place {
    node: usize,
    /// The place of the node above.
    parent: Option<usize>,
    /// The scale of all that is above.
    scale: f64,
    /// The rotation of the node above at rest, in the world.
    above: Matrix,
}

impl Place {
    /// The node's own rotation at rest, in the world.
    fn rest(&self, nodes: &[Node]) -> Matrix {
        angles::multiply(&self.above, &quaternion::to_matrix(nodes[self.node].rest()))
    }
}

impl Tree {
    pub(super) fn of(
        nodes: &[Node],
        parents: &[Option<usize>],
        tracks: &[Track],
        first: usize,
        notes: &mut Vec<String>,
    ) -> Self {
        let moves = |node: usize| tracks[node].rotation.is_some() || tracks[node].translation.is_some();
        let root_of = |node: usize| (0..nodes.len()).fold(node, |node, _| parents[node].unwrap_or(node));
        let root = root_of(first);
        let mut leads = vec![false; nodes.len()];
        for node in (0..nodes.len()).filter(|&node| moves(node)) {
            let mut above = Some(node);
            while let Some(node) = above.filter(|&node| !std::mem::replace(&mut leads[node], true)) {
                above = parents[node];
            }
        }
        let mut found = Vec::new();
        let mut pending = vec![Place { node: root, parent: None, scale: 1.0, above: IDENTITY }];
        while let Some(place) = pending.pop() {
            let node = place.node;
            if nodes[node].mesh.is_some() && !leads[node] && place.parent.is_some() {
                continue;
            }
            let joint = found.len();
            let [x, y, z] = nodes[node].scale.unwrap_or([1.0; 3]);
            let (scale, above) = (place.scale * (x + y + z) / 3.0, place.rest(nodes));
            found.push(place);
            let below = |&child: &usize| Place { node: child, parent: Some(joint), scale, above };
            pending.extend(nodes[node].children.iter().rev().map(below));
        }
        let inside = found.iter().filter(|place| moves(place.node)).count();
        let others = (0..nodes.len()).filter(|&node| moves(node)).count() - inside;
        if others > 0 {
            notes.push(format!("{others} moving nodes are in other trees, and are left out"));
        }
        let uneven = |node: &Node| {
            node.scale.is_some_and(|[x, y, z]| (x - y).abs().max((x - z).abs()) > 0.01 * x.abs())
        };
        if found.iter().any(|place| uneven(&nodes[place.node])) {
            notes.push("a scale that is not the same in all directions: its mean is taken".to_string());
        }
        Self { nodes: found }
    }

    /// The skeleton, and the sources of its joints' channels.
    pub(super) fn skeleton(
        &self,
        nodes: &[Node],
        tracks: &[Track],
        notes: &mut Vec<String>,
    ) -> (Skeleton, Vec<Source>) {
        let (mut joints, mut channels, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut names = Names::default();
        for (joint, place) in self.nodes.iter().enumerate() {
            let &Place { node, parent, scale, .. } = place;
            let found = nodes[node].name.clone().unwrap_or_else(|| format!("node_{node}"));
            let name = names.take(found.as_bytes(), 0);
            let (moves, turns) = (tracks[node].translation.is_some(), tracks[node].rotation.is_some());
            let from_rest = angles::transpose(&quaternion::to_matrix(nodes[node].rest()));
            let source = Source { node, cm: CM_PER_METRE * scale, from_rest, moves, turns };
            let start = channels.len();
            let dofs = source.dofs().map(|dof| Channel {
                name: format!("{name}.{}", dof.name()),
                dof,
                joint,
                limits: None,
            });
            channels.extend(dofs);
            let rest = nodes[node].translation.unwrap_or_default();
            let above: Option<&Joint> = parent.map(|parent: usize| &joints[parent]);
            let level = above.map_or(1, |above| above.level.saturating_add(u8::from(channels.len() > start)));
            joints.push(Joint {
                name,
                parent,
                offset: if moves {
                    [0.0; 3]
                } else {
                    angles::apply(&place.above, rest.map(|part| part * source.cm))
                },
                axis: place.rest(nodes),
                tail: [0.0; 3],
                channels: start..channels.len(),
                rotations: (start..channels.len())
                    .filter(|&channel| channels[channel].dof.is_rotation())
                    .collect(),
                level,
            });
            sources.push(source);
        }
        names.tell(notes);
        (Skeleton { joints, channels, origin: Origin::Bvh { cm_per_unit: 1.0 } }, sources)
    }
}

/// Where the channels of a joint come from.
pub(super) struct Source {
    pub(super) node: usize,
    cm: f64,
    /// What takes the node's rotation at rest away: channels are 0 there, as in other skeletons.
    from_rest: Matrix,
    moves: bool,
    turns: bool,
}

impl Source {
    fn dofs(&self) -> impl Iterator<Item = Dof> {
        let translations = if self.moves { &[Dof::Tx, Dof::Ty, Dof::Tz][..] } else { &[] };
        let rotations = if self.turns { &[Dof::Rz, Dof::Ry, Dof::Rx][..] } else { &[] };
        translations.iter().chain(rotations).copied()
    }

    /// Adds the values of its channels to `out`.
    pub(super) fn sample(&self, track: &Track, time: f64, out: &mut Vec<f64>) {
        if let Some(keys) = &track.translation {
            let line =
                |from: &[f64; 3], to: &[f64; 3], t| std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
            let moved = keys.at(time, line).map(|part| part * self.cm);
            out.extend(angles::apply(&self.from_rest, moved));
        }
        if let Some(keys) = &track.rotation {
            let turn = quaternion::to_matrix(keys.at(time, quaternion::slerp));
            out.extend(angles::euler_zyx(&angles::multiply(&self.from_rest, &turn)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_form_trees_or_are_refused() {
        let of = |text: &str| parents(&serde_json::from_str::<Vec<Node>>(text).unwrap());
        assert_eq!(of(r#"[{"children": [1, 2]}, {}, {}]"#).unwrap(), [None, Some(0), Some(0)]);
        for (text, expected) in [
            (r#"[{"children": [0]}]"#, "node 0 below node 0"),
            (r#"[{"children": [1]}, {"children": [0]}]"#, "node 0 below itself"),
            (r#"[{}, {"children": [2]}, {"children": [1, 3]}, {}]"#, "node 1 below itself"),
            (r#"[{"children": [2]}, {"children": [2]}, {}]"#, "node 2 below node 1"),
        ] {
            assert_eq!(of(text).unwrap_err().0, expected, "{text}");
        }
    }
}
