//! Files in and out: errors name the file, and an output appears whole or not at all.

use crate::file_kind::{START_BYTES, in_the_way};
use crate::signals::Temporaries;
use anyhow::{Context, Error, Result, anyhow, bail};
use std::fs::{self, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::path::Path;

/// Reads a whole file.
///
/// # Errors
/// A sentence that names the file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    mocap::import::read_bytes(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Writes a file by way of a temporary one in the same folder, which takes its name once it is whole. Where
/// `write` fails, or a signal ends the program, whatever was at `path` is left as it was, and nothing stays beside it. A link is
/// followed. A device or a pipe takes the bytes itself.
///
/// A file that the command line names twice is refused: it is an input too, or another output. That is looked up in the
/// arguments of the program, so that no command has to think of it. So are a file that is read-only, and one of another kind,
/// which may be an input that was found without being named.
///
/// # Errors
/// A sentence that names the file.
pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
    write_over(path, false, write)
}

/// As [`write()`], but over a file of `any_kind` where that was asked for.
///
/// # Errors
/// A sentence that names the file.
pub fn write_over(
    path: &Path,
    any_kind: bool,
    write: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> Result<()> {
    let failed = || format!("cannot write {}", path.display());
    if is_stream(path) {
        let mut buffer = BufWriter::new(OpenOptions::new().append(true).open(path).with_context(failed)?);
        write(&mut buffer)?;
        return buffer.flush().with_context(failed);
    }
    // Where a link leads; of what is not there yet, the path itself.
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    may_replace(path).with_context(failed)?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // `tempfile` makes private files; an output has the permissions of any other new file.
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let mut temporaries = Temporaries::lock()?;
    let file = builder.tempfile_in(folder).map_err(|error| not_there(folder, &error)).with_context(failed)?;
    let temporary = file.path().to_owned();
    temporaries.add(&temporary);
    drop(temporaries);
    let written = || {
        // The file itself and not `tempfile`'s, whose errors name the temporary file.
        let mut buffer = BufWriter::new(file.as_file());
        write(&mut buffer)?;
        buffer.flush().with_context(failed)?;
        if any_kind {
            return Ok(());
        }
        same_kind(path, &start_of(&temporary)?).with_context(failed)
    };
    let written = written();
    let mut temporaries = Temporaries::lock()?;
    let done = written.and_then(|()| {
        file.persist(path).map_err(|error| error.error).with_context(failed)?;
        Ok(())
    });
    temporaries.keep(&temporary);
    done
}

/// Opens a file that is written while the command goes on, under the same rules as [`write()`]; `start` is what it begins with.
///
/// # Errors
/// A sentence that names the file.
pub fn create(path: &Path, start: &[u8]) -> Result<fs::File> {
    let failed = || format!("cannot write {}", path.display());
    let mut file = if is_stream(path) {
        OpenOptions::new().append(true).open(path).with_context(failed)?
    } else {
        may_replace(path).with_context(failed)?;
        same_kind(path, start).with_context(failed)?;
        fs::File::create(path).with_context(failed)?
    };
    file.write_all(start).with_context(failed)?;
    Ok(file)
}

/// Whether this is a device or a pipe, or a name for what this program has open: no new file must take its place.
fn is_stream(path: &Path) -> bool {
    let of_system = ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder));
    fs::metadata(path).is_ok_and(|there| !there.is_dir() && (of_system || !there.is_file()))
}

/// Whether what is at a path may be lost, as far as its content does not matter.
fn may_replace(path: &Path) -> Result<()> {
    let Ok(there) = fs::metadata(path) else { return Ok(()) };
    if there.is_dir() {
        bail!("it is a folder, expected the name of a file");
    }
    if named_as_another(&fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())) {
        bail!(
            "the command names this file twice: an input or another output would be lost; give another name"
        );
    }
    if there.permissions().readonly() {
        bail!("the file that is there is read-only: give another name, or make it writable");
    }
    Ok(())
}

/// Whether the file at a path, if there is one, is of the kind of a new one with this start.
fn same_kind(path: &Path, new: &[u8]) -> Result<()> {
    if !path.exists() {
        return Ok(());
    }
    let mut there = start_of(path)?;
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("qmd")) {
        there = fs::read(path)?;
    }
    in_the_way(path, &there, new).map_or(Ok(()), |why| Err(anyhow!(why)))
}

fn start_of(path: &Path) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    fs::File::open(path)?.take(START_BYTES as u64).read_to_end(&mut start)?;
    Ok(start)
}

/// Whether two or more of the command's arguments are this file, which is there.
fn named_as_another(path: &Path) -> bool {
    let arguments = std::env::args_os().skip(1);
    let names = arguments.filter(|argument| {
        // Also behind the sign of `--log=FILE`.
        let bytes = argument.as_encoded_bytes();
        let value = bytes.iter().position(|&byte| byte == b'=').map(|sign| &bytes[sign + 1..]);
        let value = value.and_then(|value| std::str::from_utf8(value).ok()).map(Path::new);
        let is = |name: &Path| fs::canonicalize(name).is_ok_and(|name| name == path);
        is(Path::new(argument)) || value.is_some_and(is)
    });
    names.count() > 1
}

/// Why no file can be made in a folder, without the temporary file's name, which is in what `tempfile` says.
fn not_there(folder: &Path, error: &io::Error) -> Error {
    match error.kind() {
        ErrorKind::NotFound => anyhow!("there is no folder {}", folder.display()),
        kind => anyhow!("no file can be made in {}: {kind}", folder.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_what_was_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        write(&path, |file| Ok(file.write_all(b"old")?)).unwrap();
        write(&path, |file| Ok(file.write_all(b"old")?)).unwrap();
        let failed = write(&path, |file| {
            file.write_all(b"new, but")?;
            anyhow::bail!("no")
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn what_would_be_lost_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        let refused = |there: &str, part: &str| {
            let written = write(&path, |file| Ok(file.write_all(b"time_s,bus,servo\n")?));
            for outcome in [written, create(&path, b"time_s,bus,servo\n").map(drop)] {
                let said = format!("{:#}", outcome.unwrap_err());
                assert!(said.starts_with("cannot write ") && said.contains(part), "{said}");
            }
            assert_eq!(fs::read(&path).unwrap(), there.as_bytes());
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
        };
        let set = |read_only: bool| {
            let mut permissions = fs::metadata(&path).unwrap().permissions();
            permissions.set_readonly(read_only);
            fs::set_permissions(&path, permissions).unwrap();
        };
        fs::write(&path, "time,head.ry\n0,1\n").unwrap();
        refused("time,head.ry\n0,1\n", "is a table (CSV), and would be lost for a log of goals");
        fs::write(&path, "time_s,bus,servo\n").unwrap();
        set(true);
        refused("time_s,bus,servo\n", "read-only");
        set(false);
        create(&path, b"time_s,bus,servo\n").unwrap();
    }

    #[test]
    fn errors_name_the_file() {
        assert!(format!("{:#}", read(Path::new("no/such.amc")).unwrap_err()).contains("no/such.amc"));
        let failed = write(Path::new("no/such/folder/out"), |_| Ok(()));
        let said = format!("{:#}", failed.unwrap_err());
        assert_eq!(said, "cannot write no/such/folder/out: there is no folder no/such/folder");
    }

    #[test]
    fn a_file_that_cannot_take_its_name_says_so_without_the_temporary_one() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("out")).unwrap();
        let failed = write(&folder.path().join("out"), |file| Ok(file.write_all(b"new")?));
        let said = format!("{:#}", failed.unwrap_err());
        // The folder itself is a temporary one.
        let behind = said.split_once("/out: ").map(|(_, behind)| behind);
        assert!(behind.is_some_and(|behind| !behind.contains(".tmp")), "{said}");
    }
}
