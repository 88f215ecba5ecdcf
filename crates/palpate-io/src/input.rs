//! Files that are read whole: only plain ones, and only those that memory has room for.

use crate::error::InputError;
use crate::room::{self, gigabytes};
use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read};
use std::path::Path;

/// What something that is no plain file is called.
fn kind(meta: &Metadata) -> &'static str {
    if meta.is_dir() {
        return "a folder";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let t = meta.file_type();
        if t.is_fifo() {
            return "a named pipe";
        }
        if t.is_socket() {
            return "a socket";
        }
        if t.is_char_device() || t.is_block_device() {
            return "a device";
        }
    }
    "something else"
}

/// Refuses what is no plain file: to open a named pipe would wait for ever, and a device has no end.
///
/// # Errors
/// It is not there, or is a folder, a pipe, a socket or a device.
pub fn check_plain(path: impl AsRef<Path>) -> Result<(), InputError> {
    plain(path.as_ref()).map(|_| ())
}

fn plain(path: &Path) -> Result<u64, InputError> {
    let meta = std::fs::metadata(path).map_err(|e| InputError::io(path, &e))?;
    match meta.is_file() {
        true => Ok(meta.len()),
        false => Err(InputError::file(path, format!("is {}; a plain file is needed", kind(&meta)))),
    }
}

/// The bytes of a plain file.
///
/// # Errors
/// It is not there, may not be read, is no plain file, or is larger than the memory that is left.
pub fn read_bytes(path: impl AsRef<Path>) -> Result<Vec<u8>, InputError> {
    bytes(path.as_ref())
}

fn bytes(path: &Path) -> Result<Vec<u8>, InputError> {
    let size = plain(path)?;
    if let Some(room) = room::available().filter(|r| r.bytes < size) {
        let text = format!("has {} of bytes, and {room}", gigabytes(size));
        return Err(InputError::file(path, text));
    }
    let mut bytes = Vec::new();
    let large = |_| std::io::Error::from(ErrorKind::OutOfMemory);
    let mut read = || {
        bytes.try_reserve_exact(size as usize).map_err(large)?;
        File::open(path)?.read_to_end(&mut bytes)
    };
    read().map_err(|e| InputError::io(path, &e))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn only_plain_files_are_opened() {
        use std::os::unix::net::UnixListener;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(at("pipe")).status();
        assert!(made.is_ok_and(|s| s.success()), "mkfifo is part of every Unix");
        let _socket = UnixListener::bind(at("socket")).unwrap();
        std::fs::write(at("file"), b"abc").unwrap();
        std::os::unix::fs::symlink(at("pipe"), at("link")).unwrap();
        let said = |path: &Path| read_bytes(path).map_err(|e| e.message);
        let refused = |what: &str| Err(format!("is {what}; a plain file is needed"));
        assert_eq!(said(&at("pipe")), refused("a named pipe"));
        assert_eq!(said(&at("link")), refused("a named pipe"));
        assert_eq!(said(&at("socket")), refused("a socket"));
        assert_eq!(said(folder.path()), refused("a folder"));
        assert_eq!(said(Path::new("/dev/zero")), refused("a device"));
        assert_eq!(said(&at("none")), Err("no such file".into()));
        assert_eq!(said(&at("file")), Ok(b"abc".to_vec()));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_memory_has_no_room_for_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("huge.ply");
        // A hole of 100 terabytes takes no place on the disk.
        if File::create(&path).and_then(|f| f.set_len(100 << 40)).is_err() {
            File::create(&path).and_then(|f| f.set_len(8 << 40)).unwrap();
        }
        let e = read_bytes(&path).unwrap_err().to_string();
        assert!(e.contains("GB of bytes, and ") && e.contains("GB of memory are left"), "{e}");
    }
}
