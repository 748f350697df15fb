//! Files in and out: errors name the file, and an output appears whole or not at all.

use anyhow::{Context, Error, Result, anyhow};
use std::fs;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::Path;

/// Reads a whole file.
///
/// # Errors
/// A sentence that names the file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// Writes a file by way of a temporary one in the same folder, which takes its name once it is whole. Where
/// `write` fails, whatever was at `path` is left as it was. A link is followed. A device or a pipe takes the bytes itself.
///
/// A file that the command line names twice is refused: it is an input too, or another output. That is looked up in the
/// arguments of the program, so that no command has to think of it.
///
/// # Errors
/// A sentence that names the file.
pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
    let failed = || format!("cannot write {}", path.display());
    // Where a link leads; of what is not there yet, the path itself.
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if let Ok(there) = fs::metadata(path) {
        // A device or a pipe takes the bytes. A new file must not take its place.
        if !there.is_file() && !there.is_dir() {
            let mut buffer =
                BufWriter::new(fs::OpenOptions::new().write(true).open(path).with_context(failed)?);
            write(&mut buffer)?;
            return buffer.flush().with_context(failed);
        }
        if named_as_another(path) {
            return Err(anyhow!(
                "the command names this file twice: an input or another output would be lost; give another name"
            ))
            .with_context(failed);
        }
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // `tempfile` makes private files; an output has the permissions of any other new file.
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let file = builder.tempfile_in(folder).map_err(|error| not_there(folder, &error)).with_context(failed)?;
    // The file itself and not `tempfile`'s, whose errors name the temporary file.
    let mut buffer = BufWriter::new(file.as_file());
    write(&mut buffer)?;
    buffer.flush().with_context(failed)?;
    drop(buffer);
    file.persist(path).map_err(|error| error.error).with_context(failed)?;
    Ok(())
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
        let failed = write(&path, |file| {
            file.write_all(b"new, but")?;
            anyhow::bail!("no")
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
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
