//! Builds images for microcontrollers from this workspace, with data of the user's in them.

use crate::files;
use anyhow::{Context, Result, anyhow, bail};
use std::fs::{self, File};
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The profile of images (Cargo.toml of the workspace).
const PROFILE: &str = "firmware";

/// A binary of this workspace, and what is to be linked into it.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// Package, for instance `qemu-mps2`.
    pub package: &'a str,
    /// Its folder in the workspace.
    pub source: &'a str,
    /// Binary of the package.
    pub binary: &'a str,
    /// Features of the package, separated by commas; its default ones are off.
    pub features: &'a str,
    /// Rust's targets: an image for each.
    pub targets: &'a [&'a str],
    /// Folder in cargo's target folder where images of this kind are built, one at a time.
    pub folder: &'a str,
    /// Files that the package's build script takes: environment variable, name, content.
    pub files: &'a [(&'a str, &'a str, &'a [u8])],
    /// Other environment variables for the build script.
    pub variables: &'a [(&'a str, &'a str)],
}

impl Image<'_> {
    /// Builds it and returns the ELF files, in the order of the targets. Cargo's messages go to standard error.
    ///
    /// # Errors
    /// A sentence that says what is missing: the source, cargo, a target, or what cargo could not build.
    pub fn build(&self) -> Result<Vec<Vec<u8>>> {
        Ok(self.build_all(&[self.binary])?.concat())
    }

    /// Builds several binaries of the package at once, which is quicker than one after the other: for each its ELF files,
    /// in the order of the targets.
    ///
    /// # Errors
    /// As [`Image::build`].
    pub fn build_all(&self, binaries: &[&str]) -> Result<Vec<Vec<Vec<u8>>>> {
        let workspace = workspace(self.source)?;
        require_targets(self.targets)?;
        let folder = target_folder(workspace)?.join(self.folder);
        fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
        // The next build's files would take the place of this one's.
        let lock = File::create(folder.join("lock"))
            .with_context(|| format!("cannot write to {}", folder.display()))?;
        lock.lock().with_context(|| format!("cannot lock {}", folder.display()))?;

        let mut command = Command::new(cargo());
        command
            .args(["build", "--quiet", "--no-default-features"])
            .args(["--package", self.package, "--features", self.features])
            .args(binaries.iter().flat_map(|binary| ["--bin", binary]))
            .args(["--profile", PROFILE, "--target-dir"])
            .arg(&folder);
        for target in self.targets {
            command.args(["--target", target]);
        }
        for &(variable, name, bytes) in self.files {
            let path = folder.join(name);
            put(&path, bytes)?;
            command.env(variable, path);
        }
        let status = command
            .envs(self.variables.iter().copied())
            .current_dir(workspace)
            .stdin(Stdio::null())
            // What the caller reports goes to standard output, and nothing else does.
            .stdout(Stdio::null())
            .status()
            .context("cannot start cargo, which builds the image")?;
        if !status.success() {
            bail!("cargo could not build {} of {} ({status})", binaries.join(", "), self.package);
        }
        let built = |binary: &&str| {
            let of = |target: &&str| files::read(&folder.join(target).join(PROFILE).join(binary));
            self.targets.iter().map(of).collect()
        };
        binaries.iter().map(built).collect()
    }
}

/// Runs a program of this workspace that is built for this machine when it is needed: `bytes` go in, what comes out is
/// returned. It is built in `folder` of cargo's target folder, with the profile of images: what images there need to be
/// built, it need not build again.
///
/// # Errors
/// A sentence that says what is missing, or that the program failed; what it said goes to standard error.
pub fn run_tool(
    package: &str,
    source: &str,
    folder: &str,
    arguments: &[&str],
    bytes: &[u8],
) -> Result<Vec<u8>> {
    let workspace = workspace(source)?;
    // A file and not a pipe: a program that fails before it has read all would end us.
    let mut input = tempfile::tempfile().context("cannot create a temporary file")?;
    input.write_all(bytes).and_then(|()| input.rewind()).context("cannot write a temporary file")?;
    let output = Command::new(cargo())
        .args(["run", "--quiet", "--package", package, "--profile", PROFILE, "--target-dir"])
        .arg(target_folder(workspace)?.join(folder))
        .arg("--")
        .args(arguments)
        .current_dir(workspace)
        .stdin(input)
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start cargo, which builds {package}"))?;
    if !output.status.success() {
        bail!("{package} could not be built or failed ({})", output.status);
    }
    Ok(output.stdout)
}

/// The workspace that this program was built from, where a package's `source` is.
fn workspace(source: &str) -> Result<&'static Path> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    if !folder.join(source).is_dir() {
        bail!("images are built from Bunraku's source, which is no longer in {}", folder.display());
    }
    Ok(folder)
}

/// Writes a file of ours, over one of any kind, unless the same is there already, so that cargo builds no more than it must.
fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    if fs::read(path).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    files::write_over(path, true, |file| Ok(file.write_all(bytes)?))
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
        .context("cannot start cargo, which builds the image (see rustup.rs)")?;
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

fn require_targets(targets: &[&str]) -> Result<()> {
    let installed = |target: &str| {
        let output = Command::new("rustc").args(["--print", "target-libdir", "--target", target]).output();
        output.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir())
    };
    let missing: Vec<&str> = targets.iter().copied().filter(|target| !installed(target)).collect();
    if !missing.is_empty() {
        let missing = missing.join(" ");
        bail!("Rust's target {missing} is not installed: rustup target add {missing} (or cargo xtask setup)");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_named() {
        let image = Image {
            package: "qemu-mps2",
            source: "firmware/boards/qemu-mps2",
            binary: "qemu-mps2",
            features: "",
            targets: &["thumbv5-none-none", "thumbv4-none-none"],
            folder: "none",
            files: &[],
            variables: &[],
        };
        let error = format!("{:#}", image.build().unwrap_err());
        assert!(error.contains("rustup target add thumbv5-none-none thumbv4-none-none"), "{error}");
        let error = format!("{:#}", Image { source: "no/such", ..image }.build().unwrap_err());
        assert!(error.contains("Bunraku's source"), "{error}");
    }
}
