//! No file needs a file that needs it.
//!
//! A file needs another one where a path of it (in a `use` line or in an expression) leads there: `crate::…`, `super::…`,
//! `self::…`, or a module's own child. A path leads to the file of the last module in it, so what a `mod.rs` re-exports
//! is needed from the `mod.rs`. What only tests have (`#[cfg(test)]`) does not count.
#![allow(clippy::unwrap_used)]

mod modules;

use modules::{Files, Module, is_test};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// The crates whose files are checked, by their folder.
const CRATES: [&str; 10] = [
    "decoder-core",
    "encoder",
    "encoder/fit",
    "encoder/mocap",
    "firmware",
    "firmware/servo-wire",
    "host-sim",
    "host-sim/puppet-file",
    "host-sim/thumb-cycles",
    "host-sim/virtual-servos",
];

/// For each file, what it needs, and the line where it says so.
type Needs = BTreeMap<PathBuf, BTreeMap<PathBuf, usize>>;

/// The file that a path in `module` leads to, if it is one of this crate's.
fn file_of<'f>(files: &'f Files, module: &Module, path: &[String]) -> Option<&'f PathBuf> {
    files.of_module.get(&files.module_of(module, path)?.0)
}

/// Goes through a file for the paths in it.
struct Paths<'f> {
    files: &'f Files,
    file: &'f Path,
    module: Module,
    needs: BTreeMap<PathBuf, usize>,
}

impl Paths<'_> {
    fn add(&mut self, path: &[String], line: usize) {
        if let Some(found) = file_of(self.files, &self.module, path)
            && found != self.file
        {
            self.needs.entry(found.clone()).or_insert(line);
        }
    }

    fn add_tree(&mut self, before: &[String], tree: &syn::UseTree) {
        let with =
            |name: &syn::Ident| -> Vec<String> { before.iter().cloned().chain([name.to_string()]).collect() };
        match tree {
            syn::UseTree::Path(path) => self.add_tree(&with(&path.ident), &path.tree),
            syn::UseTree::Name(name) => self.add(&with(&name.ident), name.ident.span().start().line),
            syn::UseTree::Rename(name) => self.add(&with(&name.ident), name.ident.span().start().line),
            syn::UseTree::Glob(star) => self.add(before, star.star_token.spans[0].start().line),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.add_tree(before, tree)),
        }
    }
}

impl<'ast> Visit<'ast> for Paths<'_> {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if is_test(&item.attrs) {
            return;
        }
        self.module.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.module.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !is_test(&item.attrs) {
            self.add_tree(&[], &item.tree);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_test(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if !is_test(&item.attrs) {
            visit::visit_item_impl(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if names.len() > 1 {
            self.add(&names, path.segments[0].ident.span().start().line);
        }
        visit::visit_path(self, path);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {
        // `pub(super)` and `pub(in path)` need nothing.
    }
}

/// What each file of the crate with this root needs.
fn needs(root: &Path) -> Needs {
    let files = Files::of_crate(root);
    let mut needs = Needs::new();
    for (module, file, parsed) in &files.parsed {
        let mut paths = Paths { files: &files, file, module: module.clone(), needs: BTreeMap::new() };
        paths.visit_file(parsed);
        needs.insert(file.clone(), paths.needs);
    }
    needs
}

/// The shortest way from a file back to itself.
fn circle(needs: &Needs, start: &Path) -> Option<Vec<PathBuf>> {
    let mut before: BTreeMap<&Path, &Path> = BTreeMap::new();
    let mut waiting = VecDeque::from([start]);
    while let Some(file) = waiting.pop_front() {
        for next in needs.get(file)?.keys() {
            if next == start {
                let mut way = vec![file.to_owned()];
                while let Some(file) = before.get(way.last()?.as_path()) {
                    way.push((*file).to_owned());
                }
                way.reverse();
                return Some(way);
            }
            if !before.contains_key(next.as_path()) {
                before.insert(next, file);
                waiting.push_back(next);
            }
        }
    }
    None
}

/// Each circle of a crate's files in a line; a file is in one line at most.
fn circles(root: &Path) -> Vec<String> {
    let needs = needs(root);
    assert!(!needs.is_empty());
    let folder = root.parent().unwrap();
    let mut told = BTreeSet::new();
    let mut lines = Vec::new();
    for file in needs.keys() {
        let Some(way) = circle(&needs, file).filter(|way| !way.iter().any(|file| told.contains(file))) else {
            continue;
        };
        let name = |file: &Path| file.strip_prefix(folder).unwrap_or(file).display().to_string();
        let steps = way.iter().zip(way.iter().cycle().skip(1));
        let text = steps.map(|(from, to)| format!("{}:{} needs {}", name(from), needs[from][to], name(to)));
        lines.push(text.collect::<Vec<_>>().join(", "));
        told.extend(way);
    }
    lines
}

#[test]
fn no_crate_has_a_circle_of_files() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut found = Vec::new();
    for name in CRATES {
        for root in ["src/lib.rs", "src/main.rs"].map(|file| workspace.join(name).join(file)) {
            if root.exists() {
                found.extend(circles(&root).into_iter().map(|circle| format!("{name}: {circle}")));
            }
        }
    }
    assert!(found.is_empty(), "{} circles of files:\n{}", found.len(), found.join("\n"));
}

#[test]
fn a_planted_circle_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    };
    write("lib.rs", "pub mod low;\nmod high;\n#[cfg(test)]\nmod testing;\n");
    write("low.rs", "pub struct Low;\n#[cfg(test)]\nmod tests { use super::Low; use crate::high::High; }\n");
    write("high/mod.rs", "mod part;\nuse crate::low::{self, Low};\npub struct High(Low);\n");
    write("high/part.rs", "use super::super::low::Low;\npub(super) struct Part(Low);\n");
    let root = folder.path().join("lib.rs");
    assert_eq!(circles(&root), [""; 0]);

    // In files that a macro makes modules.
    write("made/one.rs", "use super::two::Two;\npub struct One;\n");
    write("made/two.rs", "pub struct Two;\n");
    write("made/mod.rs", "modules! { one, two }\n");
    assert_eq!(circles(&root), [""; 0]);
    write("made/two.rs", "pub struct Two(crate::made::one::One);\n");
    assert_eq!(circles(&root), ["made/one.rs:1 needs made/two.rs, made/two.rs:1 needs made/one.rs"]);
    write("made/two.rs", "pub struct Two;\n");

    // In a `use` line, through a re-export.
    write("high/mod.rs", "mod part;\npub use part::Part;\npub struct High;\n");
    write("high/part.rs", "use super::High;\npub struct Part(High);\n");
    assert_eq!(circles(&root), ["high/mod.rs:2 needs high/part.rs, high/part.rs:1 needs high/mod.rs"]);

    // In an expression, over three files.
    write("high/mod.rs", "mod part;\nuse crate::low::Low;\npub struct High;\n");
    write("low.rs", "pub struct Low;\npub fn low() {\n    crate::high::part::part();\n}\n");
    let found = circles(&root);
    assert_eq!(found.len(), 1, "{found:?}");
    for step in
        ["high/mod.rs:2 needs low.rs", "low.rs:3 needs high/part.rs", "high/part.rs:1 needs high/mod.rs"]
    {
        assert!(found[0].contains(step), "{found:?}");
    }
}
