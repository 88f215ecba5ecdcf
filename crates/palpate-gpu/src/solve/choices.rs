//! What was measured once, kept in the user's cache folder: a later process on the same device makes the same choice, and so computes the same
//! bits. A file that cannot be read or written does no harm: then each process measures for itself.

use std::io::Write as _;
use std::path::PathBuf;

/// Name of the file in the cache folder: one choice a line, what was chosen and the key with a tab between; the first of a key counts.
const FILE: &str = "palpate/choices.txt";

/// Where choices are kept.
#[derive(Clone, Debug)]
pub struct Choices {
    file: Option<PathBuf>,
}

impl Choices {
    /// Those of this user.
    pub fn of_user() -> Choices {
        Choices { file: cache_folder(|name| std::env::var_os(name).map(PathBuf::from)).map(|f| f.join(FILE)) }
    }

    /// In a file of a test's own.
    #[cfg(test)]
    pub(crate) fn at(file: PathBuf) -> Choices {
        Choices { file: Some(file) }
    }

    /// What was written down for a key; neither holds a tab or the end of a line.
    pub fn written(&self, key: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.file.as_ref()?).ok()?;
        let line = text.lines().filter_map(|l| l.split_once('\t')).find(|l| l.1 == key)?;
        Some(line.0.to_string())
    }

    /// Writes something down unless there is something for the key, and returns what counts from now on: another process may have been faster.
    pub fn write(&self, key: &str, what: &str) -> String {
        self.written(key).unwrap_or_else(|| {
            self.append(&format!("{what}\t{key}\n"));
            self.written(key).unwrap_or_else(|| what.to_string())
        })
    }

    /// Which of these names was chosen for a key.
    pub(crate) fn get(&self, key: &str, names: [&str; 2]) -> Option<usize> {
        let written = self.written(key)?;
        names.iter().position(|name| *name == written)
    }

    /// Keeps a choice unless there is one for the key, and returns what counts from now on.
    pub(crate) fn keep(&self, key: &str, names: [&str; 2], chosen: usize) -> usize {
        let written = self.write(key, names[chosen]);
        names.iter().position(|name| *name == written).unwrap_or(chosen)
    }

    fn append(&self, line: &str) {
        let Some(file) = &self.file else { return };
        let written = file.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| {
            // One write of one short line at the end of the file: processes do not cut each other's lines.
            std::fs::OpenOptions::new().create(true).append(true).open(file)?.write_all(line.as_bytes())
        });
        // Not kept is measured again.
        drop(written);
    }
}

/// The user's cache folder: `XDG_CACHE_HOME`, else what the system has.
fn cache_folder(var: impl Fn(&str) -> Option<PathBuf>) -> Option<PathBuf> {
    let set = |name| var(name).filter(|p| p.is_absolute());
    let own = || match (cfg!(windows), cfg!(target_vendor = "apple")) {
        (true, _) => set("LOCALAPPDATA"),
        (_, true) => set("HOME").map(|h| h.join("Library/Caches")),
        _ => set("HOME").map(|h| h.join(".cache")),
    };
    set("XDG_CACHE_HOME").or_else(own)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 2] = ["csr", "free"];

    #[test]
    fn the_first_choice_of_a_key_stays() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let choices = || Choices::at(folder.path().join("deep").join(FILE));
        assert_eq!(choices().get("a", NAMES), None);
        assert_eq!(choices().keep("a", NAMES, 1), 1);
        assert_eq!(choices().keep("b", NAMES, 0), 0);
        // A process that measured otherwise does as the first did.
        assert_eq!(choices().keep("a", NAMES, 0), 1);
        assert_eq!((choices().get("a", NAMES), choices().get("b", NAMES)), (Some(1), Some(0)));
    }

    #[test]
    fn files_that_are_none_do_no_harm() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let file = folder.path().join("choices");
        std::fs::write(&file, "nonsense\nfast\ta\n").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(Choices::at(file.clone()).get("a", NAMES), None);
        // No folder can be where a file is; and there may be no place at all.
        for choices in [Choices::at(file.join("below")), Choices { file: None }] {
            assert_eq!(choices.keep("a", NAMES, 1), 1);
            assert_eq!(choices.get("a", NAMES), None);
        }
    }

    #[test]
    fn the_folder_is_the_one_that_is_stated() {
        let root = std::env::temp_dir();
        let stated = |name: &str| Some(root.join(name));
        assert_eq!(cache_folder(stated), stated("XDG_CACHE_HOME"));
        // Relative paths are to be ignored, says the XDG base directory specification.
        assert_eq!(cache_folder(|name| (name == "XDG_CACHE_HOME").then(|| "here".into())), None);
        assert!(cache_folder(|name| stated(name).filter(|_| name != "XDG_CACHE_HOME")).is_some());
    }
}
