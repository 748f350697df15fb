//! Builds the image of the board `qemu-mps2` with a clip and a joint map in it.

use crate::files;
use crate::puppet::{self, Map};
use anyhow::{Context, Result, anyhow, bail};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// QEMU's name of the board.
pub const MACHINE: &str = "mps2-an386";

/// The board's clock in hertz (Arm AN386, "Clocks").
pub const CLOCK_HZ: u32 = 25_000_000;

const PACKAGE: &str = "qemu-mps2";
const TARGET: &str = "thumbv7em-none-eabi";
const PROFILE: &str = "firmware";

/// The workspace that this program was built from.
fn workspace() -> Result<&'static Path> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    if !folder.join("firmware/boards").join(PACKAGE).is_dir() {
        bail!(
            "the image for the board is built from Bunraku's source, which is no longer in {}",
            folder.display()
        );
    }
    Ok(folder)
}

/// Builds the image that plays `clip` (the bytes of a .qmd) by `map`, and puts it at `to`.
///
/// `centihertz` is the rate to play at, in hundredths of a hertz, or 0 for the clip's own. Cargo's messages go to
/// standard error.
///
/// # Errors
/// A sentence that says what is missing: the source, cargo, the target, or what cargo could not build.
pub fn build(clip: &[u8], map: &Map, centihertz: u16, to: &Path) -> Result<()> {
    let workspace = workspace()?;
    require_target()?;
    // Where cargo builds images, one at a time: the next one's clip would take this one's place.
    let folder = target_folder(workspace)?.join("play");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let lock =
        File::create(folder.join("lock")).with_context(|| format!("cannot write to {}", folder.display()))?;
    lock.lock().with_context(|| format!("cannot lock {}", folder.display()))?;

    let (clip_path, map_path) = (folder.join("clip.qmd"), folder.join("map.postcard"));
    put(&clip_path, clip)?;
    put(&map_path, &puppet::to_bytes(map)?)?;
    let built = Command::new(cargo())
        .args(["build", "--quiet", "--message-format", "json-render-diagnostics"])
        .args([
            "--no-default-features",
            "--package",
            PACKAGE,
            "--target",
            TARGET,
            "--profile",
            PROFILE,
            "--target-dir",
        ])
        .arg(&folder)
        .env("BUNRAKU_CLIP", clip_path)
        .env("BUNRAKU_MAP", map_path)
        .env("BUNRAKU_CENTIHERTZ", centihertz.to_string())
        .env("DEFMT_LOG", "info")
        .current_dir(workspace)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| "cannot start cargo, which builds the image for the board")?;
    if !built.status.success() {
        bail!("cargo could not build the image for the board {PACKAGE} ({})", built.status);
    }
    let image =
        executable(&built.stdout).ok_or_else(|| anyhow!("cargo did not say where it put the image"))?;
    fs::copy(&image, to).with_context(|| format!("cannot copy {} to {}", image.display(), to.display()))?;
    Ok(())
}

/// Writes a file unless it is there already, so that cargo builds no more than it must.
fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    if fs::read(path).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    files::write(path, |file| Ok(file.write_all(bytes)?))
}

/// The cargo that runs us, or else the one on the path.
fn cargo() -> PathBuf {
    std::env::var_os("CARGO").map_or_else(|| PathBuf::from("cargo"), PathBuf::from)
}

/// Cargo's target folder of the workspace.
fn target_folder(workspace: &Path) -> Result<PathBuf> {
    let output = Command::new(cargo())
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .current_dir(workspace)
        .output()
        .context("cannot start cargo, which builds the image for the board (see rustup.rs)")?;
    if !output.status.success() {
        bail!(
            "cargo metadata failed in {}: {}",
            workspace.display(),
            String::from_utf8_lossy(&output.stderr).trim()
        );
    }
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).context("cargo metadata")?;
    let folder = metadata.get("target_directory").and_then(|folder| folder.as_str());
    folder.map(PathBuf::from).ok_or_else(|| anyhow!("cargo metadata names no target folder"))
}

fn require_target() -> Result<()> {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    let found = output.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir());
    if !found {
        bail!("Rust's target {TARGET} is not installed (rustup target add {TARGET})");
    }
    Ok(())
}

/// The path of the binary in cargo's JSON messages.
fn executable(messages: &[u8]) -> Option<PathBuf> {
    messages.split(|&byte| byte == b'\n').rev().find_map(|line| {
        let message: serde_json::Value = serde_json::from_slice(line).ok()?;
        message.get("executable")?.as_str().map(PathBuf::from)
    })
}
