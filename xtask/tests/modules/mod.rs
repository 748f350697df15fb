//! The modules of a crate, read from its sources.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Names of modules from the crate's root on.
pub type Module = Vec<String>;

/// A crate's modules, and the files that they are in.
#[derive(Default)]
pub struct Files {
    pub of_module: BTreeMap<Module, PathBuf>,
    pub parsed: Vec<(Module, PathBuf, syn::File)>,
    /// Files and folders of modules that are there for tests only.
    tests: Vec<PathBuf>,
}

impl Files {
    /// Reads a crate from its root file on.
    pub fn of_crate(root: &Path) -> Self {
        let mut files = Self::default();
        files.read(Module::new(), root.to_owned());
        let folder = root.with_file_name("");
        // Beside a `main.rs` a file may be the program's or the library's; there, `mod` lines alone count.
        if !folder.join("main.rs").exists() {
            files.read_others(&folder);
        }
        files
    }

    /// Reads a module's file and those of its children.
    fn read(&mut self, module: Module, file: PathBuf) {
        let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let is_root = ["lib.rs", "main.rs", "mod.rs"].iter().any(|name| file.ends_with(name));
        let folder = if is_root { file.with_file_name("") } else { file.with_extension("") };
        self.of_module.insert(module.clone(), file.clone());
        self.read_children(&module, &file, &folder, &parsed.items);
        self.parsed.push((module, file, parsed));
    }

    /// Reads the files below a crate's folder that no `mod` line led to: a macro declares their modules. Those of tests, and
    /// what lies below them, are left out.
    fn read_others(&mut self, folder: &Path) {
        let read: Vec<PathBuf> = self.of_module.values().cloned().collect();
        let mut others = Vec::new();
        rust_files(folder, &mut others);
        others.retain(|file| !read.contains(file) && !self.tests.iter().any(|test| file.starts_with(test)));
        for file in others {
            // What an earlier one of these has read by its `mod` lines.
            if self.of_module.values().any(|known| *known == file) {
                continue;
            }
            let inside = file.strip_prefix(folder).expect("a file below the folder").with_extension("");
            let mut module: Module = inside.iter().map(|name| name.to_string_lossy().into_owned()).collect();
            if module.last().is_some_and(|name| name == "mod") {
                module.pop();
            }
            self.read(module, file);
        }
    }

    fn read_children(&mut self, module: &Module, file: &Path, folder: &Path, items: &[syn::Item]) {
        for item in items {
            let syn::Item::Mod(child) = item else { continue };
            let name = child.ident.to_string();
            if is_test(&child.attrs) {
                self.tests.extend([folder.join(format!("{name}.rs")), folder.join(name)]);
                continue;
            }
            let path: Module = module.iter().cloned().chain([name.clone()]).collect();
            if let Some((_, items)) = &child.content {
                self.of_module.insert(path.clone(), file.to_owned());
                self.read_children(&path, file, &folder.join(&name), items);
            } else {
                let alone = folder.join(format!("{name}.rs"));
                let found = if alone.is_file() { alone } else { folder.join(name).join("mod.rs") };
                self.read(path, found);
            }
        }
    }

    /// The module that a path in `module` leads to, if it is one of this crate's, and how many names of the path do so.
    pub fn module_of(&self, module: &Module, path: &[String]) -> Option<(Module, usize)> {
        let mut at = module.clone();
        let mut used = 1;
        match path.first()?.as_str() {
            "crate" => at.clear(),
            "self" => {}
            "super" => {
                used = path.iter().take_while(|name| *name == "super").count();
                at.truncate(at.len().checked_sub(used)?);
            }
            // A child of this module; everything else is another crate's, or was brought here by a `use`.
            name => at.push(name.to_owned()),
        }
        self.of_module.get(&at)?;
        for name in &path[used..] {
            at.push(name.clone());
            if !self.of_module.contains_key(&at) {
                at.pop();
                break;
            }
            used += 1;
        }
        Some((at, used))
    }
}

/// Whether something is there for tests only.
pub fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute.parse_args::<syn::Path>().is_ok_and(|condition| condition.is_ident("test"))
    })
}

/// Files of Rust below a folder, `mod.rs` before what is beside it.
fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort_by_key(|path| (path.is_dir(), !path.ends_with("mod.rs"), path.clone()));
    for entry in entries {
        if entry.is_dir() {
            rust_files(&entry, found);
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            found.push(entry);
        }
    }
}
