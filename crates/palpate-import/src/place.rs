//! A source on disk: a file, or a folder with what lies in it.

use crate::error::{ImportError, refuse};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Folders deeper than this below a source are not looked into.
const DEPTH: usize = 4;

/// More files than this are no recording.
const MOST: usize = 200_000;

/// A source and what lies in it.
pub struct Place {
    /// As it was named.
    pub path: PathBuf,
    /// Every plain file: the source itself, or those in its folder, with numbers in names in the order of their values.
    pub files: Vec<PathBuf>,
}

impl Place {
    /// Looks at a source.
    ///
    /// # Errors
    /// It is not there, is neither a plain file nor a folder, or holds no file or too many.
    pub fn open(path: &Path) -> Result<Place, ImportError> {
        let Ok(meta) = std::fs::metadata(path) else { return refuse(path, "no such file or folder") };
        let mut files = Vec::new();
        if meta.is_file() {
            files.push(path.to_path_buf());
        } else if meta.is_dir() {
            gather(path, 0, &mut files)?;
            files.sort_by_cached_key(|f| natural(&f.strip_prefix(path).unwrap_or(f).to_string_lossy()));
        } else {
            return refuse(path, "is neither a plain file nor a folder");
        }
        if files.is_empty() {
            return refuse(path, "holds no file");
        }
        Ok(Place { path: path.to_path_buf(), files })
    }

    /// Files with one of these endings (without the dot).
    pub fn with_ending<'a>(&'a self, endings: &'a [&str]) -> impl Iterator<Item = &'a PathBuf> {
        self.files.iter().filter(move |f| has_ending(f, endings))
    }

    /// The only file with one of these endings.
    pub fn only(&self, endings: &[&str]) -> Option<&PathBuf> {
        let mut found = self.files.iter().filter(|f| has_ending(f, endings));
        found.next().filter(|_| found.next().is_none())
    }

    /// Name of a file as seen from the source.
    pub fn name(&self, file: &Path) -> String {
        let inside = file.strip_prefix(&self.path).ok().filter(|n| !n.as_os_str().is_empty());
        // A source that is a file goes by its own name.
        let own = || file.file_name().map_or(file, Path::new);
        inside.unwrap_or_else(own).to_string_lossy().to_ascii_lowercase()
    }

    /// What the source is called: its name without folder and ending.
    pub fn title(&self) -> String {
        let path = self.path.canonicalize().unwrap_or_else(|_| self.path.clone());
        path.file_stem().map_or_else(|| "recording".into(), |s| s.to_string_lossy().into_owned())
    }
}

fn gather(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), ImportError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) => return refuse(folder, format!("cannot be read: {e}")),
    };
    for entry in entries.flatten() {
        let path = entry.path();
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        match std::fs::metadata(&path) {
            Ok(m) if m.is_file() => files.push(path),
            Ok(m) if m.is_dir() && depth < DEPTH => gather(&path, depth + 1, files)?,
            _ => {}
        }
        if files.len() > MOST {
            return refuse(folder, format!("holds more than {MOST} files; name the folder of one recording"));
        }
    }
    Ok(())
}

/// True for a file with one of these endings.
pub fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|e| endings.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// First bytes of a file; none where it cannot be read.
pub fn head(path: &Path, most: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A pipe would wait for ever.
    if palpate_io::check_plain(path).is_err() {
        return bytes;
    }
    if let Ok(file) = std::fs::File::open(path) {
        let _ = file.take(most).read_to_end(&mut bytes);
    }
    bytes
}

/// First bytes of a file as text.
pub fn head_text(path: &Path) -> String {
    let bytes = head(path, 64 << 10);
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes)).into_owned()
}

/// A key by which `frame10` comes after `frame9`: digits as numbers of their length, the rest as it is.
fn natural(name: &str) -> Vec<(usize, String)> {
    let mut parts: Vec<(usize, String)> = Vec::new();
    let mut digits = None;
    for c in name.chars() {
        if digits == Some(c.is_ascii_digit()) {
            parts.last_mut().expect("a part was begun").1.push(c);
        } else {
            parts.push((0, c.to_string()));
        }
        digits = Some(c.is_ascii_digit());
    }
    for (length, text) in &mut parts {
        if text.starts_with(|c: char| c.is_ascii_digit()) {
            let bare = text.trim_start_matches('0');
            *length = bare.len() + 1;
            *text = format!("{bare} {text}");
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_by_value() {
        let mut names = ["d10.png", "d9.png", "d010.png", "c.png", "d1.5.png"].map(String::from).to_vec();
        names.sort_by_cached_key(|n| natural(n));
        assert_eq!(names, ["c.png", "d1.5.png", "d9.png", "d010.png", "d10.png"]);
    }
}
