//! Files are written whole or not at all.

use crate::error::OutputError;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file under a temporary name beside it and renames it when it is complete. A path that exists and is no plain
/// file (a device, a pipe) is written directly.
///
/// # Errors
/// The file and the operating system's reason (disk full, no permission, no such folder).
pub fn write_file(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), OutputError> {
    let mut content = Some(content);
    write_whole(path.as_ref(), &mut |out| content.take().map_or(Ok(()), |content| content(out)))
}

/// [`write_file`], compiled once for all contents.
fn write_whole(path: &Path, content: &mut dyn FnMut(&mut dyn Write) -> std::io::Result<()>) -> Result<(), OutputError> {
    let special = fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir());
    let target = if special { path.to_path_buf() } else { temporary(path) };
    let written = (|| {
        let mut file = BufWriter::new(fs::File::create(&target)?);
        content(&mut file)?;
        file.flush()?;
        if !special {
            // Some file systems report a full disk only here.
            file.get_ref().sync_all()?;
            fs::rename(&target, path)?;
        }
        Ok(())
    })();
    written.map_err(|e: std::io::Error| {
        if !special {
            // The first error is the one to report; the leftover may not even exist.
            let _ = fs::remove_file(&target);
        }
        OutputError::new(path, e)
    })
}

fn temporary(path: &Path) -> PathBuf {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!(".{name}.{}.tmp", std::process::id()))
}

/// Makes a folder and those above it.
///
/// # Errors
/// The folder and the operating system's reason.
pub fn make_folder(path: impl AsRef<Path>) -> Result<(), OutputError> {
    fs::create_dir_all(&path).map_err(|e| OutputError::new(&path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_leftover() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_file(&path, |w| w.write_all(b"old")).unwrap();
        let e = write_file(&path, |w| {
            w.write_all(b"half")?;
            Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
        });
        assert!(e.unwrap_err().to_string().contains("a.txt: cannot be written"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let e = write_file(folder.path().join("no/such/b.txt"), |_| Ok(())).unwrap_err();
        assert!(e.file.ends_with("no/such/b.txt"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error_with_its_cause() {
        let e = write_file("/dev/full", |w| w.write_all(&[0; 100_000])).unwrap_err();
        assert!(e.to_string().starts_with("/dev/full: cannot be written: No space left"), "{e}");
    }
}
