//! `cargo fmt` passes over modules that a macro declares, as the lists of codecs and of entropy stages do: their files are
//! checked here.

use bunraku_tests::workspace;
use std::path::PathBuf;
use std::process::Command;

/// Folders with such files.
const FOLDERS: [&str; 3] = ["decoder-core/src/codec", "decoder-core/src/entropy", "encoder/src/codec"];

#[test]
fn files_of_the_lists_are_formatted() {
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in FOLDERS {
        let entries = std::fs::read_dir(workspace().join(folder)).expect("the folder is there");
        files.extend(entries.flatten().map(|entry| entry.path()).filter(|path| path.extension().is_some()));
    }
    assert!(files.len() > 20, "{files:?}");
    let output = Command::new("rustfmt")
        .args(["--check", "--edition", "2024", "--config-path"])
        .arg(workspace().join("rustfmt.toml"))
        .args(&files)
        .output()
        .expect("rust-toolchain.toml names rustfmt");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "run `rustfmt --edition 2024` on these files: {said}");
}
