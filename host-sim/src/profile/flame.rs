//! Cycles by function and what it calls, as a flame graph draws them.

use crate::plot::flame::Node;
use thumb_cycles::CallPath;

/// The tree below the path with number `root`.
pub fn tree(paths: &[CallPath], root: usize) -> Node {
    let Some(path) = paths.get(root) else {
        return Node::default();
    };
    // A path comes after its parent.
    let below = (root + 1..paths.len()).filter(|&at| paths[at].parent == Some(root));
    let mut children: Vec<Node> = below.map(|at| tree(paths, at)).collect();
    children.sort_by(|a, b| b.cycles.cmp(&a.cycles).then_with(|| a.name.cmp(&b.name)));
    Node { name: path.name.clone(), cycles: path.inclusive, itself: path.cycles, children }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_a_tree_with_the_most_expensive_first() {
        let path = |name: &str, parent, cycles, inclusive| CallPath {
            name: name.to_owned(),
            parent,
            calls: 1,
            cycles,
            inclusive,
        };
        let paths = [
            path("main", None, 9, 60),
            path("frame", Some(0), 1, 51),
            path("less", Some(1), 20, 20),
            path("more", Some(1), 25, 30),
            path("deep", Some(3), 5, 5),
        ];
        let node = tree(&paths, 1);
        assert_eq!((node.name.as_str(), node.cycles, node.itself, node.depth()), ("frame", 51, 1, 3));
        let names: Vec<&str> = node.children.iter().map(|child| child.name.as_str()).collect();
        assert_eq!(names, ["more", "less"]);
    }
}
