//! Images for a microcontroller, built when a test needs them.

use crate::workspace;
use std::path::PathBuf;
use std::process::Command;

/// Builds the binary `binary` (`.wasm` where the target is WebAssembly) of package `package` for `target` with `profile` and gives its path.
///
/// Each set of features has a target directory of its own, or tests that run side by side would overwrite each
/// other's image.
///
/// # Panics
/// Where cargo fails, with what it said.
pub fn image(package: &str, binary: &str, target: &str, profile: &str, features: &[&str]) -> PathBuf {
    let folder = workspace().join("target").join("images").join(if features.is_empty() {
        "plain".to_owned()
    } else {
        features.join("-")
    });
    let output = Command::new(env!("CARGO"))
        .args([
            "build",
            "--quiet",
            "--package",
            package,
            "--bin",
            binary.trim_end_matches(".wasm"),
            "--target",
            target,
            "--profile",
            profile,
        ])
        .args(["--features", &features.join(",")])
        .arg("--target-dir")
        .arg(&folder)
        .current_dir(workspace())
        .output()
        .unwrap_or_else(|error| panic!("cannot start cargo: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo build of {package} for {target}:\n{said}");
    folder.join(target).join(profile).join(binary)
}
