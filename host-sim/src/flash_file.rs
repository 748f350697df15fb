//! The file that holds a virtual device's flash: recognised before a byte of it is written, and one process's alone.

use anyhow::{Context, Result, anyhow, bail};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// What a directory of clips begins with (docs/STORE.md).
const MAGIC: &[u8] = b"BNKD";

/// Opens a flash of so many sectors, and reads it: an empty or new file is erased flash. The file is locked until it is closed.
///
/// The directory of clips is in the first two sectors. A file is a flash where one of them begins with a directory, or both are
/// erased.
///
/// # Errors
/// A sentence where another process has the file, or it is another kind of file, or larger.
pub fn open(path: &Path, sectors: usize, sector: usize) -> Result<(File, Vec<u8>)> {
    let name = path.display();
    if path.exists() && !path.metadata().is_ok_and(|there| there.is_file()) {
        bail!("{name} is no file; name the file that is to hold the flash");
    }
    // Nothing is truncated before it is known what the file is.
    let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    let mut file = options.with_context(|| format!("cannot open {name}"))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            bail!("another device keeps its flash in {name}; stop it, or name another file")
        }
        Err(TryLockError::Error(error)) => {
            return Err(anyhow!(error)).with_context(|| format!("cannot lock {name}"));
        }
    }
    let (found, most) =
        (file.metadata().with_context(|| format!("cannot read {name}"))?.len(), sectors * sector);
    let kib = |bytes: usize| bytes / 1024;
    let mut first = vec![0xff; 2 * sector];
    let length = usize::try_from(found).unwrap_or(usize::MAX).min(first.len());
    file.read_exact(&mut first[..length]).with_context(|| format!("cannot read {name}"))?;
    let (one, other) = first.split_at(sector);
    let is_flash =
        [one, other].iter().any(|sector| sector.starts_with(MAGIC)) || first.iter().all(|&byte| byte == 0xff);
    if !is_flash || found % sector as u64 != 0 {
        bail!(
            "{name} is no device's flash: it has {found} bytes, and its first {} KiB neither hold a directory of clips nor are \
             erased; name another file, or one that is not there yet",
            kib(first.len())
        );
    }
    if found > most as u64 {
        bail!(
            "{name} is a flash of {} KiB, and the device has {}: say --flash-kib {}",
            found / 1024,
            kib(most),
            found / 1024
        );
    }
    file.seek(SeekFrom::Start(0)).with_context(|| format!("cannot read {name}"))?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).with_context(|| format!("cannot read {name}"))?;
    bytes.resize(most, 0xff);
    Ok((file, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECTOR: usize = 256;

    fn refused(path: &Path) -> String {
        let before = std::fs::read(path).ok();
        let said = format!("{:#}", open(path, 4, SECTOR).unwrap_err());
        assert_eq!(std::fs::read(path).ok(), before, "it is as it was");
        assert!(said.starts_with(&path.display().to_string()) || said.contains(&path.display().to_string()));
        said
    }

    #[test]
    fn only_a_flash_is_opened_and_only_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("puppet.flash");
        let (held, bytes) = open(&path, 4, SECTOR).unwrap();
        assert_eq!(bytes, [0xff; 4 * SECTOR]);
        assert!(refused(&path).contains("another device keeps its flash in"));
        drop(held);
        let mut flash = vec![0xff; 4 * SECTOR];
        for (at, is_flash) in [(0, true), (SECTOR, true), (1, false), (2 * SECTOR, true)] {
            flash.fill(0xff);
            flash[at..at + 4].copy_from_slice(b"BNKD");
            std::fs::write(&path, &flash).unwrap();
            if is_flash {
                assert_eq!(open(&path, 4, SECTOR).unwrap().1, flash);
            } else {
                assert!(refused(&path).contains("is no device's flash"));
            }
        }
        // What people name by mistake: a clip, a puppet, a text that is shorter than a sector.
        for other in [&b"MCLP"[..], b"[puppet]\n", &[0; 4 * SECTOR]] {
            std::fs::write(&path, other).unwrap();
            assert!(refused(&path).contains("is no device's flash"));
        }
        // An erased one that is cut is none; a shorter one grows, and a larger one is not cut.
        std::fs::write(&path, [0xff; SECTOR + 1]).unwrap();
        assert!(refused(&path).contains("is no device's flash"));
        std::fs::write(&path, [0xff; 2 * SECTOR]).unwrap();
        assert_eq!(open(&path, 4, SECTOR).unwrap().1.len(), 4 * SECTOR);
        std::fs::write(&path, [0xff; 8 * SECTOR]).unwrap();
        assert!(refused(&path).contains("say --flash-kib 2"));
        assert!(refused(folder.path()).contains("is no file"));
    }
}
