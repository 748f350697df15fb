//! What the crates that can be published offer is what docs/api says: no public item changes unnoticed.
//!
//! A snapshot has a crate's public items without bodies, comments and values, and without fields that are private; an
//! implementation is with its type or trait. What a macro makes is not seen, but the macro's call is. Where a change is
//! meant, run
//!
//!     cargo xtask api
//!
//! and say in the commit whether users have to change their code.
#![allow(clippy::unwrap_used)]

mod modules;

use modules::{Files, Module, is_test};
use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;
use syn::punctuated::Punctuated;
use syn::{Fields, ImplItem, Item, TraitItem, Type, UseTree, Visibility};

/// Attributes that a crate's users depend on.
const KEPT: [&str; 6] = ["cfg", "deprecated", "derive", "macro_export", "non_exhaustive", "repr"];

const COMMAND: &str = "cargo xtask api";

/// A crate that is read, and what of it was found to be public.
struct Api<'f> {
    files: &'f Files,
    /// The items of each module.
    items: BTreeMap<Module, &'f [Item]>,
    /// The public items, by the module in which users find them.
    public: BTreeMap<Module, Vec<Item>>,
    /// Where users find each public type and trait.
    home: BTreeMap<String, Module>,
    /// Modules whose public items were taken, and where to.
    done: BTreeSet<(Module, Module)>,
}

/// The snapshot of the crate with this root.
fn snapshot(root: &Path) -> String {
    let files = Files::of_crate(root);
    let mut items = BTreeMap::new();
    for (module, _, file) in &files.parsed {
        collect_items(module, &file.items, &mut items);
    }
    let mut api =
        Api { files: &files, items, public: BTreeMap::new(), home: BTreeMap::new(), done: BTreeSet::new() };
    api.take_module(&Vec::new(), &Vec::new());
    api.take_implementations();
    let mut text = String::new();
    for (module, items) in api.public {
        let path: String = module.iter().map(|name| format!("::{name}")).collect();
        writeln!(text, "// crate{path}\n").unwrap();
        let printed = items.into_iter().map(|item| print(vec![item]));
        for item in printed.collect::<BTreeSet<_>>() {
            text.push_str(&item);
            text.push('\n');
        }
    }
    text
}

fn collect_items<'f>(module: &Module, items: &'f [Item], all: &mut BTreeMap<Module, &'f [Item]>) {
    all.insert(module.clone(), items);
    for item in items {
        if let Item::Mod(child) = item
            && let Some((_, items)) = &child.content
            && !is_test(&child.attrs)
        {
            collect_items(&below(module, &child.ident.to_string()), items, all);
        }
    }
}

fn below(module: &Module, name: &str) -> Module {
    module.iter().cloned().chain([name.to_owned()]).collect()
}

fn print(items: Vec<Item>) -> String {
    prettyplease::unparse(&syn::File { shebang: None, attrs: Vec::new(), frontmatter: None, items })
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

impl Api<'_> {
    fn take(&mut self, shown: &Module, name: Option<String>, item: Item) {
        if let Some(name) = name {
            self.home.entry(name).or_insert_with(|| shown.clone());
        }
        self.public.entry(shown.clone()).or_default().push(item);
    }

    /// Takes the public items of `module`, which users find in `shown`.
    fn take_module(&mut self, module: &Module, shown: &Module) {
        if !self.done.insert((module.clone(), shown.clone())) {
            return;
        }
        for item in self.items.get(module).copied().unwrap_or_default() {
            match item {
                Item::Mod(child) if is_public(&child.vis) && !is_test(&child.attrs) => {
                    let name = child.ident.to_string();
                    self.take_module(&below(module, &name), &below(shown, &name));
                }
                Item::Use(line) if is_public(&line.vis) && !is_test(&line.attrs) => {
                    self.take_use(module, shown, &mut Vec::new(), &line.tree, item);
                }
                _ => {
                    if let Some((name, item)) = public_item(item) {
                        self.take(shown, name, item);
                    }
                }
            }
        }
    }

    /// Takes what a `pub use` in `module` shows in `shown`.
    fn take_use(
        &mut self,
        module: &Module,
        shown: &Module,
        path: &mut Vec<String>,
        tree: &UseTree,
        line: &Item,
    ) {
        match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.take_use(module, shown, path, &part.tree, line);
                path.pop();
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.take_use(module, shown, path, tree, line);
                }
            }
            UseTree::Name(name) => {
                path.push(name.ident.to_string());
                self.take_path(module, shown, path, line);
                path.pop();
            }
            UseTree::Rename(name) => {
                path.push(name.ident.to_string());
                self.take_path(module, shown, path, line);
                path.pop();
                // The item has its own name above; this line says by which users know it here.
                if let Item::Use(whole) = line {
                    let tree = only(&whole.tree, &name.rename.to_string());
                    self.take(shown, None, Item::Use(syn::ItemUse { tree, ..whole.clone() }));
                }
            }
            UseTree::Glob(_) => match self.files.module_of(module, path) {
                Some((target, used)) if used == path.len() => self.take_module(&target, shown),
                _ => self.take(shown, None, line.clone()),
            },
        }
    }

    /// Takes the item or the module that a path leads to; the line itself where that is another crate's.
    fn take_path(&mut self, module: &Module, shown: &Module, path: &[String], line: &Item) {
        let Some((target, used)) = self.files.module_of(module, path) else {
            return self.take(shown, None, line.clone());
        };
        let Some(name) = path.get(used) else {
            let name = path.last().cloned().unwrap_or_default();
            return self.take_module(&target, &below(shown, &name));
        };
        for item in self.items.get(&target).copied().unwrap_or_default() {
            match item {
                // Shown by a module in between.
                Item::Use(inner) if names(&inner.tree, name) => {
                    self.take_use(&target, shown, &mut Vec::new(), &only(&inner.tree, name), item);
                }
                _ => match public_item(item) {
                    Some((Some(found), item)) if found == *name => self.take(shown, Some(found), item),
                    _ => {}
                },
            }
        }
    }

    /// Takes the implementations of public types and traits.
    fn take_implementations(&mut self) {
        let mut merged: BTreeMap<(Module, String), syn::ItemImpl> = BTreeMap::new();
        for item in self.items.values().copied().flatten() {
            let Item::Impl(found) = item else { continue };
            if is_test(&found.attrs) {
                continue;
            }
            let of_type = last_name(&found.self_ty).and_then(|name| self.home.get(&name));
            let of_trait = found.trait_.as_ref().and_then(|(path, _)| path.segments.last());
            let of_trait = of_trait.and_then(|segment| self.home.get(&segment.ident.to_string()));
            let Some(home) = of_type.or(of_trait) else { continue };
            let mut shown = found.clone();
            shown.attrs.retain(is_kept);
            shown.items =
                found.items.iter().filter_map(|item| public_part(item, found.trait_.is_some())).collect();
            if shown.trait_.is_none() && shown.items.is_empty() {
                continue;
            }
            let header = syn::ItemImpl { items: Vec::new(), ..shown.clone() };
            let key = (home.clone(), print(vec![Item::Impl(header)]));
            match merged.get_mut(&key) {
                Some(other) => other.items.extend(shown.items),
                None => {
                    merged.insert(key, shown);
                }
            }
        }
        for ((home, _), mut found) in merged {
            found.items.sort_by_key(part_name);
            self.public.entry(home).or_default().push(Item::Impl(found));
        }
    }
}

/// Whether a `use` brings something of this name.
fn names(tree: &UseTree, name: &str) -> bool {
    match tree {
        UseTree::Path(part) => names(&part.tree, name),
        UseTree::Group(group) => group.items.iter().any(|tree| names(tree, name)),
        UseTree::Name(part) => part.ident == name,
        UseTree::Rename(part) => part.rename == name,
        UseTree::Glob(_) => false,
    }
}

/// The part of a `use` that brings this name.
fn only(tree: &UseTree, name: &str) -> UseTree {
    match tree {
        UseTree::Path(part) => {
            UseTree::Path(syn::UsePath { tree: Box::new(only(&part.tree, name)), ..part.clone() })
        }
        UseTree::Group(group) => {
            let found = group.items.iter().find(|tree| names(tree, name));
            found.map_or_else(|| tree.clone(), |tree| only(tree, name))
        }
        _ => tree.clone(),
    }
}

fn last_name(of: &Type) -> Option<String> {
    match of {
        Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()),
        Type::Reference(reference) => last_name(&reference.elem),
        _ => None,
    }
}

fn is_kept(attribute: &syn::Attribute) -> bool {
    KEPT.iter().any(|name| attribute.path().is_ident(name))
}

fn no_block() -> syn::Block {
    syn::Block { brace_token: syn::token::Brace::default(), stmts: Vec::new() }
}

fn no_value() -> syn::Expr {
    syn::Expr::Infer(syn::ExprInfer {
        attrs: Vec::new(),
        underscore_token: syn::token::Underscore::default(),
    })
}

/// Drops the fields that are private; one of them stands for all.
fn public_fields(fields: &mut Fields) {
    let public = |fields: &Punctuated<syn::Field, syn::Token![,]>, private: &str| {
        let mut kept: Punctuated<_, syn::Token![,]> = fields
            .iter()
            .filter(|field| is_public(&field.vis))
            .cloned()
            .map(|mut field| {
                field.attrs.retain(is_kept);
                field
            })
            .collect();
        if kept.len() < fields.len() {
            let text = format!("struct Private {private}");
            let private = syn::parse_str::<syn::ItemStruct>(&text).unwrap();
            kept.extend(private.fields);
        }
        kept
    };
    match fields {
        Fields::Named(named) => named.named = public(&named.named, "{ private: _ }"),
        Fields::Unnamed(unnamed) => unnamed.unnamed = public(&unnamed.unnamed, "(_);"),
        Fields::Unit => {}
    }
}

/// A public item as users see it, and its name if it has one.
fn public_item(item: &Item) -> Option<(Option<String>, Item)> {
    let mut item = item.clone();
    let name = match &mut item {
        Item::Fn(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            *found.block = no_block();
            found.sig.ident.to_string()
        }
        Item::Struct(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            public_fields(&mut found.fields);
            found.ident.to_string()
        }
        Item::Enum(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            for variant in &mut found.variants {
                variant.attrs.retain(is_kept);
                variant.fields.iter_mut().for_each(|field| field.attrs.retain(is_kept));
            }
            found.ident.to_string()
        }
        Item::Trait(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            for part in &mut found.items {
                match part {
                    TraitItem::Fn(part) => {
                        part.attrs.retain(is_kept);
                        part.default = part.default.as_ref().map(|_| no_block());
                    }
                    TraitItem::Const(part) => part.attrs.retain(is_kept),
                    TraitItem::Type(part) => part.attrs.retain(is_kept),
                    _ => {}
                }
            }
            found.ident.to_string()
        }
        Item::Type(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            found.ident.to_string()
        }
        Item::Const(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            *found.expr = no_value();
            found.ident.to_string()
        }
        Item::Static(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            *found.expr = no_value();
            found.ident.to_string()
        }
        Item::Macro(found) => {
            let defines = found.mac.path.is_ident("macro_rules");
            let exported = found.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export"));
            if defines && !exported {
                return None;
            }
            found.attrs.retain(is_kept);
            found.mac.tokens = match defines {
                true => TokenStream::new(),
                false => without_comments(found.mac.tokens.clone()),
            };
            return Some((found.ident.as_ref().map(ToString::to_string), item));
        }
        _ => return None,
    };
    Some((Some(name), item))
}

/// What users see of a part of an implementation; of a trait's only what its types and constants are.
fn public_part(part: &ImplItem, of_trait: bool) -> Option<ImplItem> {
    let mut part = part.clone();
    match &mut part {
        ImplItem::Fn(found) if is_public(&found.vis) && !is_test(&found.attrs) => {
            found.attrs.retain(is_kept);
            found.block = no_block();
        }
        ImplItem::Const(found) if is_public(&found.vis) => {
            found.attrs.retain(is_kept);
            found.expr = no_value();
        }
        ImplItem::Type(found) if of_trait => found.attrs.retain(is_kept),
        _ => return None,
    }
    Some(part)
}

fn part_name(part: &ImplItem) -> String {
    match part {
        ImplItem::Fn(found) => found.sig.ident.to_string(),
        ImplItem::Const(found) => found.ident.to_string(),
        ImplItem::Type(found) => found.ident.to_string(),
        _ => String::new(),
    }
}

/// The tokens without `#[doc = "…"]`.
fn without_comments(tokens: TokenStream) -> TokenStream {
    let mut kept: Vec<TokenTree> = Vec::new();
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                let comment = group.delimiter() == Delimiter::Bracket
                    && group.stream().into_iter().next().is_some_and(|first| first.to_string() == "doc");
                if comment {
                    kept.pop();
                } else {
                    let inner = without_comments(group.stream());
                    kept.push(TokenTree::Group(Group::new(group.delimiter(), inner)));
                }
            }
            other => kept.push(other),
        }
    }
    kept.into_iter().collect()
}

/// Lines that only one of two texts has, with where they are from.
fn difference(before: &str, now: &str) -> String {
    let lines = |text: &str| text.lines().map(str::to_owned).collect::<Vec<_>>();
    let (before, now) = (lines(before), lines(now));
    let mut text = String::new();
    for (sign, these, those) in [('-', &before, &now), ('+', &now, &before)] {
        let those: BTreeSet<&String> = those.iter().collect();
        for line in these.iter().filter(|line| !those.contains(line)) {
            writeln!(text, "  {sign} {line}").unwrap();
        }
    }
    if text.is_empty() { "  the same lines, in another order or number\n".to_owned() } else { text }
}

/// The workspace's packages that can be published: name and folder.
fn published(workspace: &Path) -> BTreeMap<String, String> {
    let table = |path: &Path| -> toml::Table { fs::read_to_string(path).unwrap().parse().unwrap() };
    let root = table(&workspace.join("Cargo.toml"));
    let members = root["workspace"]["members"].as_array().unwrap();
    let mut found = BTreeMap::new();
    for folder in members.iter().filter_map(toml::Value::as_str) {
        let manifest = table(&workspace.join(folder).join("Cargo.toml"));
        let package = &manifest["package"];
        if package.get("publish").and_then(toml::Value::as_bool) != Some(false) {
            found.insert(package["name"].as_str().unwrap().to_owned(), folder.to_owned());
        }
    }
    found
}

#[test]
fn public_items_are_those_of_the_snapshots() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let folder = workspace.join("docs/api");
    let bless = std::env::var_os("BUNRAKU_BLESS").is_some();
    let crates = published(workspace);
    assert!(!crates.is_empty());
    let mut complaints = String::new();
    for (name, source) in &crates {
        let now = snapshot(&workspace.join(source).join("src/lib.rs"));
        let path = folder.join(name).with_extension("txt");
        if bless {
            fs::create_dir_all(&folder).unwrap();
            fs::write(&path, &now).unwrap();
        }
        match fs::read_to_string(&path) {
            Ok(before) if before == now => {}
            Ok(before) => write!(complaints, "{name}:\n{}", difference(&before, &now)).unwrap(),
            Err(_) => writeln!(complaints, "{name}: there is no docs/api/{name}.txt").unwrap(),
        }
    }
    for entry in fs::read_dir(&folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if !crates.contains_key(&name) {
            writeln!(complaints, "{name}: docs/api has it, but no package of this name can be published")
                .unwrap();
        }
    }
    assert!(
        complaints.is_empty(),
        "public items are not those of docs/api; if that is meant, run `{COMMAND}`\n{complaints}"
    );
}

#[test]
fn a_snapshot_has_what_users_see_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write(
        "lib.rs",
        "mod hidden;\npub mod open;\npub use hidden::{Shown, Listener};\npub use other::Thing;\nfn private() {}\n",
    );
    write(
        "hidden.rs",
        "/// A comment.\n#[derive(Clone)]\npub struct Shown { pub seen: u8, unseen: u8 }\n\
         impl Shown { pub fn call(&self) -> u8 { self.seen } fn own(&self) {} pub(crate) fn near(&self) {} }\n\
         pub struct NotShown;\nimpl NotShown { pub fn never(&self) {} }\n\
         pub trait Listener { type Word; fn hear(&self) { todo!() } }\n\
         impl Listener for Shown { type Word = u8; }\n#[cfg(test)]\nmod tests { pub fn test() {} }\n",
    );
    write("open.rs", "pub const SIZE: usize = 4;\npub use crate::hidden::Shown as Known;\n");
    let text = snapshot(&folder.path().join("lib.rs"));
    for part in [
        "#[derive(Clone)]\npub struct Shown {\n    pub seen: u8,\n    private: _,\n}",
        "pub fn call(&self) -> u8 {}",
        "pub trait Listener",
        "fn hear(&self) {}",
        "impl Listener for Shown {\n    type Word = u8;\n}",
        "pub use other::Thing;",
        "// crate::open\n",
        "pub const SIZE: usize = _;",
        "pub use crate::hidden::Shown as Known;",
    ] {
        assert!(text.contains(part), "{part:?} is missing in\n{text}");
    }
    for part in ["comment", "private()", "fn own", "near", "NotShown", "never", "test", "todo", "= 4"] {
        assert!(!text.contains(part), "{part:?} is in\n{text}");
    }
}

#[test]
fn a_change_is_told_by_its_lines() {
    assert_eq!(difference("a\nb\n", "a\nc\n"), "  - b\n  + c\n");
}
