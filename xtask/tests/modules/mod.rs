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
}

impl Files {
    /// Reads a module's file and those of its children.
    pub fn read(&mut self, module: Module, file: PathBuf) {
        let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let is_root = ["lib.rs", "main.rs", "mod.rs"].iter().any(|name| file.ends_with(name));
        let folder = if is_root { file.with_file_name("") } else { file.with_extension("") };
        self.of_module.insert(module.clone(), file.clone());
        self.read_children(&module, &file, &folder, &parsed.items);
        self.parsed.push((module, file, parsed));
    }

    fn read_children(&mut self, module: &Module, file: &Path, folder: &Path, items: &[syn::Item]) {
        for item in items {
            let syn::Item::Mod(child) = item else { continue };
            if is_test(&child.attrs) {
                continue;
            }
            let name = child.ident.to_string();
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
