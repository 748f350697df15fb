//! Cycles by function and what it calls, as a flame graph draws them.

use thumb_cycles::CallPath;

/// A function's cycles, all frames together, on one path of calls.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// The function.
    pub name: String,
    /// Cycles, with those of the functions that it calls.
    pub cycles: u64,
    /// Cycles in the function itself.
    pub itself: u64,
    /// What it calls, by the most cycles.
    pub children: Vec<Node>,
}

impl Node {
    /// The tree below the path with number `root`.
    pub fn of(paths: &[CallPath], root: usize) -> Self {
        let Some(path) = paths.get(root) else {
            return Self::default();
        };
        // A path comes after its parent.
        let below = (root + 1..paths.len()).filter(|&at| paths[at].parent == Some(root));
        let mut children: Vec<Self> = below.map(|at| Self::of(paths, at)).collect();
        children.sort_by(|a, b| b.cycles.cmp(&a.cycles).then_with(|| a.name.cmp(&b.name)));
        Self { name: path.name.clone(), cycles: path.inclusive, itself: path.cycles, children }
    }

    /// Rows that a drawing takes.
    pub fn depth(&self) -> usize {
        1 + self.children.iter().map(Self::depth).max().unwrap_or(0)
    }
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
        let node = Node::of(&paths, 1);
        assert_eq!((node.name.as_str(), node.cycles, node.itself, node.depth()), ("frame", 51, 1, 3));
        let names: Vec<&str> = node.children.iter().map(|child| child.name.as_str()).collect();
        assert_eq!(names, ["more", "less"]);
    }
}
