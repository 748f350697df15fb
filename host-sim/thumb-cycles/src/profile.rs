//! How cycles and stack were used, by function.

use crate::call_tree::CallTree;
use crate::machine::Machine;

/// What a function cost by itself, without those that it called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SelfCycles {
    /// Its name, demangled; `?` is all code outside of functions.
    pub name: String,
    /// Bytes of its code.
    pub bytes: u32,
    /// Cycles.
    pub cycles: u64,
}

/// A function as called along one path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallPath {
    /// Its name, demangled.
    pub name: String,
    /// Number of the path that called it, always a smaller one; the first has none.
    pub parent: Option<usize>,
    /// How often it was called on this path.
    pub calls: u64,
    /// Cycles in the function itself.
    pub cycles: u64,
    /// Cycles in it and in all that it called.
    pub inclusive: u64,
}

impl Machine {
    /// Begins to measure the stack anew, from where it is.
    pub fn reset_stack_mark(&mut self) {
        self.stack_top = self.cpu.r[13];
        self.stack_low = self.stack_top;
    }

    /// Self cycles of each function that ran, most first. What exceptions take to begin and end is no function's.
    ///
    /// Costs a look at every halfword of code that was executed.
    pub fn self_cycles(&self) -> Vec<SelfCycles> {
        let functions = self.image.functions();
        let mut cycles = vec![0u64; functions.len() + 1];
        for region in self.bus.memory.regions() {
            for (at, &count) in region.cycles.iter().enumerate().filter(|&(_, &count)| count > 0) {
                let number = self.image.function_at(region.base + 2 * at as u32).unwrap_or(functions.len());
                cycles[number] += count;
            }
        }
        let mut list: Vec<SelfCycles> = cycles
            .into_iter()
            .enumerate()
            .filter(|&(_, cycles)| cycles > 0)
            .map(|(number, cycles)| match functions.get(number) {
                Some(function) => SelfCycles { name: function.name.clone(), bytes: function.size, cycles },
                None => SelfCycles { name: "?".to_owned(), bytes: 0, cycles },
            })
            .collect();
        list.sort_by(|a, b| b.cycles.cmp(&a.cycles).then_with(|| a.name.cmp(&b.name)));
        list
    }

    /// The call paths, each after its parent: what a flame graph draws. A function that was jumped to rather than
    /// called (a tail call) counts for the one that jumped. Time asleep is nobody's.
    pub fn call_paths(&mut self) -> Vec<CallPath> {
        let now = self.awake();
        let image = &self.image;
        let name = |address: u32| {
            let function = image.function_at(address).and_then(|number| image.functions().get(number));
            function.map_or_else(|| format!("{address:#010x}"), |function| function.name.clone())
        };
        let mut list: Vec<CallPath> = self
            .calls
            .paths(now)
            .iter()
            .enumerate()
            .map(|(number, path)| CallPath {
                name: name(path.address),
                parent: (number > 0).then_some(path.parent),
                calls: path.calls,
                cycles: path.cycles,
                inclusive: path.cycles,
            })
            .collect();
        for number in (1..list.len()).rev() {
            let inclusive = list[number].inclusive;
            if let Some(parent) = list[number].parent {
                list[parent].inclusive += inclusive;
            }
        }
        list
    }

    /// Forgets the cycles of functions and call paths, so that a part of a run can be looked at by itself.
    pub fn reset_profile(&mut self) {
        self.bus.memory.forget_counts();
        self.calls = CallTree::new(self.cpu.pc, self.awake());
    }
}
