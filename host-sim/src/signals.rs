//! What a signal asks for: an end in order where something moves, and that no temporary file stays.

use anyhow::{Context, Result, anyhow};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// How often somebody asked this program to end.
static ASKED: AtomicUsize = AtomicUsize::new(0);

/// Whether somebody looks at [`ASKED`].
static IS_HEARD: AtomicBool = AtomicBool::new(false);

/// Files and folders that are not to stay.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// The exit code of a program that was asked to end by Ctrl-C, as shells have it.
const INTERRUPTED: i32 = 130;

/// Counts how often Ctrl-C was pressed, or somebody asked this program to end by a signal. Without this a signal ends the
/// program at once.
///
/// # Errors
/// Where the computer does not let this program take signals.
pub fn asked_to_end() -> Result<&'static AtomicUsize> {
    listen()?;
    IS_HEARD.store(true, Ordering::Relaxed);
    Ok(&ASKED)
}

/// The files that are not to stay. While this is held, no signal ends the program.
pub(crate) struct Temporaries(MutexGuard<'static, Vec<PathBuf>>);

impl Temporaries {
    /// From now on signals are taken.
    pub(crate) fn lock() -> Result<Self> {
        listen()?;
        Ok(Self(TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    /// A file that a signal removes, until it is [kept](Self::keep).
    pub(crate) fn add(&mut self, path: &Path) {
        self.0.push(path.to_owned());
    }

    /// A file that has its own name now, or is gone.
    pub(crate) fn keep(&mut self, path: &Path) {
        self.0.retain(|other| other != path);
    }
}

/// A folder among those of the system for temporary ones. It goes with what is in it, be it in the end or at a signal.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Result<Self> {
        let mut temporaries = Temporaries::lock()?;
        let folder = tempfile::tempdir().context("cannot create a temporary folder")?;
        temporaries.add(folder.path());
        Ok(Self(folder))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Ok(mut temporaries) = Temporaries::lock() {
            temporaries.keep(self.0.path());
        }
    }
}

fn listen() -> Result<()> {
    static TAKEN: OnceLock<Result<(), String>> = OnceLock::new();
    let taken = TAKEN.get_or_init(|| ctrlc::set_handler(note).map_err(|error| error.to_string()));
    taken.clone().map_err(|error| anyhow!("cannot take Ctrl-C: {error}"))
}

fn note() {
    if IS_HEARD.load(Ordering::Relaxed) {
        ASKED.fetch_add(1, Ordering::Relaxed);
        return;
    }
    let left = TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner);
    // Nobody is left to be told where one cannot be removed.
    for path in left.iter() {
        drop(if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) });
    }
    std::process::exit(INTERRUPTED);
}
