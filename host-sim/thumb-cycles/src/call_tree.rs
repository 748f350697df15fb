//! Who called whom, with the cycles of each: a tree of call paths, as a flame graph draws it.

/// Deeper calls count for the function that made them.
const MAX_DEPTH: usize = 256;

/// A call path: a function as called from its parent's path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Node {
    /// Address that was called; the address of the first instruction for the root.
    pub address: u32,
    /// Number of the calling path; the root is its own.
    pub parent: usize,
    /// Cycles in the function itself, on this path.
    pub cycles: u64,
    /// How often it was entered.
    pub calls: u64,
    children: Vec<usize>,
}

/// The tree and where the image is in it.
#[derive(Clone, Debug)]
pub(crate) struct CallTree {
    paths: Vec<Node>,
    current: usize,
    /// Cycle up to which `current` has its cycles.
    since: u64,
    /// Return address of each call that has not returned, and the path to go back to.
    stack: Vec<(u32, usize)>,
}

impl CallTree {
    /// Only a root, at `address`.
    pub fn new(address: u32, now: u64) -> Self {
        let root = Node { address, parent: 0, cycles: 0, calls: 1, children: Vec::new() };
        Self { paths: vec![root], current: 0, since: now, stack: Vec::new() }
    }

    fn settle(&mut self, now: u64) {
        if let Some(path) = self.paths.get_mut(self.current) {
            path.cycles += now - self.since;
        }
        self.since = now;
    }

    /// A call of `address` that will come back to `return_to`.
    pub fn enter(&mut self, address: u32, return_to: u32, now: u64) {
        if self.stack.len() >= MAX_DEPTH {
            return;
        }
        self.settle(now);
        let parent = self.current;
        let found = self.paths.get(parent).and_then(|path| {
            let same = |&&child: &&usize| self.paths.get(child).is_some_and(|path| path.address == address);
            path.children.iter().find(same).copied()
        });
        let child = found.unwrap_or_else(|| {
            let number = self.paths.len();
            self.paths.push(Node { address, parent, cycles: 0, calls: 0, children: Vec::new() });
            if let Some(path) = self.paths.get_mut(parent) {
                path.children.push(number);
            }
            number
        });
        if let Some(path) = self.paths.get_mut(child) {
            path.calls += 1;
        }
        self.stack.push((return_to, parent));
        self.current = child;
    }

    /// A jump to `address`, which is a return if one of the calls is to come back there.
    pub fn leave(&mut self, address: u32, now: u64) {
        let Some(at) = self.stack.iter().rposition(|&(return_to, _)| return_to == address) else {
            return;
        };
        self.settle(now);
        if let Some(&(_, path)) = self.stack.get(at) {
            self.current = path;
        }
        self.stack.truncate(at);
    }

    /// The tree until `now`: a path's parent comes before it.
    pub fn paths(&mut self, now: u64) -> &[Node] {
        self.settle(now);
        &self.paths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_go_to_the_path_that_spends_them() {
        let mut calls = CallTree::new(0x100, 0);
        calls.enter(0x200, 0x104, 10);
        calls.enter(0x300, 0x204, 15);
        calls.leave(0x204, 35);
        calls.leave(0x999, 36);
        calls.enter(0x300, 0x208, 40);
        calls.leave(0x208, 41);
        calls.leave(0x104, 50);
        let of = |node: &Node| (node.address, node.cycles, node.calls);
        let paths: Vec<_> = calls.paths(60).iter().map(of).collect();
        assert_eq!(paths, [(0x100, 20, 1), (0x200, 19, 1), (0x300, 21, 2)]);
    }
}
