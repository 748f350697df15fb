//! What README and docs name is there, and their lines are short.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Most characters of a line of prose. Tables and commands may be longer.
const WIDTH: usize = 119;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// Files of the repository, from its root.
fn git_files(pattern: &str) -> Vec<PathBuf> {
    let listed = Command::new("git").args(["ls-files", pattern]).current_dir(workspace()).output().unwrap();
    String::from_utf8(listed.stdout).unwrap().lines().map(PathBuf::from).collect()
}

/// The pages of the repository, from its root.
fn pages() -> Vec<PathBuf> {
    let pages = git_files("*.md");
    assert!(pages.len() > 10, "{pages:?}");
    pages
}

/// Lines of a page with their numbers, without those of commands and examples.
fn prose(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut fenced = false;
    text.lines().enumerate().filter_map(move |(index, line)| {
        if line.starts_with("```") {
            fenced = !fenced;
        }
        (!fenced && !line.starts_with("    ")).then_some((index + 1, line))
    })
}

/// Targets of links to files in a line, and names of files in backticks that begin with a folder of the workspace.
fn named(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    for part in line.split("](").skip(1) {
        let target = part.split([')', '#']).next().unwrap_or_default();
        if !target.is_empty() && !target.contains("://") && !target.starts_with("mailto:") {
            found.push(target.to_owned());
        }
    }
    for name in line.split('`').skip(1).step_by(2) {
        let is_file = name.split('/').count() > 1
            && [".rs", ".md", ".toml", ".py", ".x", ".json", ".in", ".mjs"]
                .iter()
                .any(|end| name.ends_with(end))
            && !name.contains(['*', ' ', '<', '$', '{', '…']);
        if is_file && !name.starts_with(['/', '.']) && !name.starts_with("target/") {
            found.push(name.to_owned());
        }
    }
    found
}

/// What a page names and is not there. A link is from the page's folder or the root. A name may be shortened: it is the end
/// of a file's path.
fn missing(page: &Path, text: &str) -> Vec<String> {
    let folder = workspace().join(page).parent().unwrap().to_owned();
    let files = git_files("*");
    let is_end = |name: &str| files.iter().any(|file| file.ends_with(name));
    let mut missing = Vec::new();
    for (line, content) in prose(text) {
        for name in named(content) {
            if !folder.join(&name).exists() && !workspace().join(&name).exists() && !is_end(&name) {
                missing.push(format!("{}:{line}: there is no {name}", page.display()));
            }
        }
    }
    missing
}

#[test]
fn files_that_pages_name_are_there() {
    let mut found = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(workspace().join(&page)).unwrap();
        found.extend(missing(&page, &text));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn lines_of_prose_are_short() {
    let mut found = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(workspace().join(&page)).unwrap();
        for (line, content) in prose(&text) {
            let length = content.chars().count();
            if length > WIDTH && !content.starts_with('|') {
                found.push(format!(
                    "{}:{line}: {length} characters, expected at most {WIDTH}",
                    page.display()
                ));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn what_is_not_there_is_found() {
    let text = "See [it](nowhere.md#x), [us](https://example.org) and `xtask/src/none.rs`.\n\n    [no](command.md)\n";
    let found = missing(Path::new("README.md"), text);
    assert_eq!(found, ["README.md:1: there is no nowhere.md", "README.md:1: there is no xtask/src/none.rs"]);
    assert_eq!(missing(Path::new("README.md"), "`xtask/src/main.rs` and [docs](docs/FORMAT.md)"), [""; 0]);
}
