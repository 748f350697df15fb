//! Names of joints: each once, and as text.

use std::collections::HashMap;

use super::text::{self, quote};

/// The names of joints, each once.
#[derive(Default)]
pub(super) struct Names {
    /// Each name, and the number that is tried next where it comes again.
    taken: HashMap<String, usize>,
    /// Joints whose name came before, and the first of them: its name, line and new name.
    again: usize,
    first_again: Option<(String, usize, String)>,
    /// Joints whose name is not UTF-8, and the first such name.
    not_utf8: usize,
    first_not_utf8: String,
}

impl Names {
    /// The name for a joint that the file calls `found` in that line.
    pub(super) fn take(&mut self, found: &[u8], line: usize) -> String {
        let name = text::name(found);
        if str::from_utf8(found).is_err() {
            if self.not_utf8 == 0 {
                self.first_not_utf8.clone_from(&name);
            }
            self.not_utf8 += 1;
        }
        let unique = self.unique(&name);
        if unique != name {
            self.again += 1;
            self.first_again.get_or_insert_with(|| (name, line, unique.clone()));
        }
        unique
    }

    /// `name`, with a number behind where it is taken.
    pub(super) fn unique(&mut self, name: &str) -> String {
        let Some(next) = self.taken.get(name).copied() else {
            self.taken.insert(name.to_string(), 2);
            return name.to_string();
        };
        let mut free = (next..).map(|number| (number, format!("{name}_{number}")));
        let (number, unique) = free.find(|(_, name)| !self.taken.contains_key(name)).unwrap_or_default();
        self.taken.insert(name.to_string(), number + 1);
        self.taken.insert(unique.clone(), 2);
        unique
    }

    pub(super) fn tell(&self, notes: &mut Vec<String>) {
        if let Some((name, line, unique)) = &self.first_again {
            let (name, unique) = (quote(name.as_bytes()), quote(unique.as_bytes()));
            notes.push(format!(
                "{} with a name that came before: {name} in line {line} is called {unique}",
                joints(self.again)
            ));
        }
        if self.not_utf8 > 0 {
            notes.push(format!(
                "{} with a name that is not UTF-8: its other bytes are written as in {}",
                joints(self.not_utf8),
                quote(self.first_not_utf8.as_bytes())
            ));
        }
    }
}

fn joints(count: usize) -> String {
    if count == 1 { "1 joint".to_string() } else { format!("{count} joints") }
}
