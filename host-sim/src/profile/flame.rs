//! Cycles by function and what it calls, as a flame graph draws them.

use crate::thumb::CallPath;

/// A function's cycles, all frames together, on one path of calls.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// The function.
    pub name: String,
    /// Cycles, with those of the functions that it calls.
    pub cycles: u64,
    /// What it calls, by the most cycles.
    pub children: Vec<Node>,
}

impl Node {
    /// The tree below `root`, an index of `paths`.
    pub fn of(paths: &[CallPath], root: usize) -> Self {
        let Some(path) = paths.get(root) else {
            return Self::default();
        };
        // A path comes after its parent.
        let below =
            (root + 1..paths.len()).filter(|&at| paths.get(at).is_some_and(|path| path.parent == Some(root)));
        let mut children: Vec<Self> = below.map(|at| Self::of(paths, at)).collect();
        children.sort_by(|a, b| b.cycles.cmp(&a.cycles).then_with(|| a.name.cmp(&b.name)));
        Self { name: path.name.clone(), cycles: path.inclusive, children }
    }

    /// Rows that a drawing takes.
    pub fn depth(&self) -> usize {
        1 + self.children.iter().map(Self::depth).max().unwrap_or(0)
    }

    /// Cycles without the children's.
    pub fn itself(&self) -> u64 {
        self.cycles - self.children.iter().map(|child| child.cycles).sum::<u64>()
    }

    /// Adds each function's own cycles to `functions`.
    pub fn own_cycles(&self, functions: &mut Vec<(String, u64)>) {
        match functions.iter_mut().find(|(name, _)| *name == self.name) {
            Some((_, cycles)) => *cycles += self.itself(),
            None => functions.push((self.name.clone(), self.itself())),
        }
        self.children.iter().for_each(|child| child.own_cycles(functions));
    }
}
