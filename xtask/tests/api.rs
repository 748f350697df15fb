//! The public items of the crates that may be published are those of docs/api.
//!
//! A line of docs/api/CRATE.txt that goes or changes is a break for the crate's users, which takes a new version (semver); a
//! line that is added is none. `cargo xtask api` writes the files anew. Whatever is declared `pub` counts, also in a module that
//! is not, since it may be exported from elsewhere.

use quote::ToTokens;
use std::fs;
use std::path::{Path, PathBuf};
use syn::punctuated::Punctuated;
use syn::{Attribute, Fields, ImplItem, Item, TraitItem, Visibility};

fn workspace() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Folders of the packages whose manifest does not forbid to publish them.
fn publishable(folder: &Path, found: &mut Vec<PathBuf>) {
    let manifest = folder.join("Cargo.toml");
    if manifest.is_file() {
        let text = read(&manifest);
        if text.contains("[package]") && !text.lines().any(|line| line == "publish = false") {
            found.push(folder.to_owned());
        }
    }
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
        let path = entry.unwrap_or_else(|error| panic!("{}: {error}", folder.display())).path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with('.') && name != "target" && name != "src" {
            publishable(&path, found);
        }
    }
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Whether an item is there in tests only.
fn is_of_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.to_token_stream().to_string() == "# [cfg (test)]")
}

fn without_hidden(fields: &mut Fields) {
    let keep = |fields: &mut Punctuated<syn::Field, syn::Token![,]>| {
        *fields = std::mem::take(fields).into_iter().filter(|field| is_public(&field.vis)).collect();
        fields.iter_mut().for_each(|field| field.attrs.clear());
    };
    match fields {
        Fields::Named(fields) => keep(&mut fields.named),
        Fields::Unnamed(fields) => keep(&mut fields.unnamed),
        Fields::Unit => {}
    }
}

/// The public items of a module's file and of those below it, a line each.
fn of_file(module: &str, file: &Path, lines: &mut Vec<String>) {
    let parsed = syn::parse_file(&read(file)).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let is_root = ["lib.rs", "mod.rs"].iter().any(|name| file.ends_with(name));
    let folder = if is_root { file.with_file_name("") } else { file.with_extension("") };
    of_items(module, &folder, parsed.items, lines);
}

fn of_items(module: &str, folder: &Path, items: Vec<Item>, lines: &mut Vec<String>) {
    let line = |what: &dyn ToTokens| format!("{module}: {}", tidy(&what.to_token_stream().to_string()));
    let mut below = vec![];
    for item in items {
        match item {
            Item::Mod(item) if !is_of_tests(&item.attrs) => below.push(item),
            Item::Fn(item) if is_public(&item.vis) => lines.push(line(&item.sig)),
            Item::Struct(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                without_hidden(&mut item.fields);
                lines.push(line(&item));
            }
            Item::Enum(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                for variant in &mut item.variants {
                    variant.attrs.clear();
                    variant.fields.iter_mut().for_each(|field| field.attrs.clear());
                }
                lines.push(line(&item));
            }
            Item::Trait(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                for member in &mut item.items {
                    match member {
                        TraitItem::Fn(member) => (member.attrs, member.default) = (vec![], None),
                        TraitItem::Const(member) => member.attrs.clear(),
                        TraitItem::Type(member) => member.attrs.clear(),
                        _ => {}
                    }
                }
                lines.push(line(&item));
            }
            Item::Const(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                lines.push(line(&item));
            }
            Item::Type(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                lines.push(line(&item));
            }
            Item::Use(mut item) if is_public(&item.vis) => {
                item.attrs.clear();
                lines.push(line(&item));
            }
            Item::Impl(mut item) if !is_of_tests(&item.attrs) => {
                item.attrs.clear();
                let members = std::mem::take(&mut item.items);
                let head = tidy(&item.to_token_stream().to_string());
                let head = head.trim_end_matches(" { }").trim_end_matches(" {}");
                if item.trait_.is_some() {
                    lines.push(format!("{module}: {head}"));
                    continue;
                }
                for member in members {
                    let text = match member {
                        ImplItem::Fn(member) if is_public(&member.vis) => {
                            member.sig.to_token_stream().to_string()
                        }
                        ImplItem::Const(member) if is_public(&member.vis) => {
                            format!("const {}: {}", member.ident, member.ty.to_token_stream())
                        }
                        _ => continue,
                    };
                    lines.push(format!("{module}: {head}: {}", tidy(&text)));
                }
                continue;
            }
            _ => {}
        }
    }
    for item in below {
        let name = format!("{module}::{}", item.ident);
        let folder = folder.join(item.ident.to_string());
        match item.content {
            Some((_, items)) => of_items(&name, &folder, items, lines),
            None => {
                let (file, root) = (folder.with_extension("rs"), folder.join("mod.rs"));
                of_file(&name, if file.is_file() { &file } else { &root }, lines);
            }
        }
    }
}

/// Tokens as a person writes them, more or less.
fn tidy(tokens: &str) -> String {
    let mut text = tokens.split_whitespace().collect::<Vec<_>>().join(" ");
    for (from, to) in [
        (" :: ", "::"),
        (" : ", ": "),
        (" , ", ", "),
        (" ;", ";"),
        ("& ", "&"),
        (" < ", "<"),
        (" >", ">"),
        (" (", "("),
        ("( ", "("),
        (" )", ")"),
    ] {
        text = text.replace(from, to);
    }
    text
}

#[test]
fn the_public_items_are_those_of_the_snapshot() {
    let mut folders = vec![];
    publishable(workspace(), &mut folders);
    assert!(!folders.is_empty(), "no crate may be published");
    let write = std::env::var_os("BUNRAKU_WRITE_API").is_some();
    let mut wrong = vec![];
    for folder in folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut lines = vec![];
        of_file(&name.replace('-', "_"), &folder.join("src/lib.rs"), &mut lines);
        lines.sort();
        lines.dedup();
        assert!(lines.len() > 5, "{name}: {lines:?}");
        let path = workspace().join("docs/api").join(&name).with_extension("txt");
        if write {
            fs::create_dir_all(workspace().join("docs/api"))
                .unwrap_or_else(|error| panic!("docs/api: {error}"));
            fs::write(&path, lines.join("\n") + "\n")
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            continue;
        }
        let before = fs::read_to_string(&path).unwrap_or_default();
        let before: Vec<&str> = before.lines().collect();
        let gone = before
            .iter()
            .filter(|line| !lines.iter().any(|now| now == *line))
            .map(|line| format!("- {line}"));
        let new =
            lines.iter().filter(|line| !before.contains(&line.as_str())).map(|line| format!("+ {line}"));
        let changes: Vec<String> = gone.chain(new).collect();
        if !changes.is_empty() {
            wrong.push(format!("{}:\n{}", path.display(), changes.join("\n")));
        }
    }
    assert!(
        wrong.is_empty(),
        "{}\nwhere this is meant, `cargo xtask api` writes the files anew",
        wrong.join("\n")
    );
}
