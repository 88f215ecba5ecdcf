//! The machine of this process, as devices know it: its clock, and what was measured once, kept in the user's cache folder. A later process on
//! the same device makes the same choice, and so computes the same bits. A file that cannot be read or written does no harm: then each process
//! measures for itself.

use palpate_gpu::Host;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Name of the file in the cache folder: one choice a line, what was chosen and the key with a tab between; the first of a key counts.
const FILE: &str = "palpate/choices.txt";

/// The machine, to open a device with ([`palpate_gpu::Gpu::open_for`]).
pub fn host() -> Arc<dyn Host> {
    let folder = cache_folder(|name| std::env::var_os(name).map(PathBuf::from));
    Arc::new(Machine { begun: Instant::now(), file: folder.map(|f| f.join(FILE)) })
}

#[derive(Debug)]
struct Machine {
    begun: Instant,
    /// Where choices are kept.
    file: Option<PathBuf>,
}

impl Host for Machine {
    fn seconds(&self) -> Option<f64> {
        Some(self.begun.elapsed().as_secs_f64())
    }

    fn written(&self, key: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.file.as_ref()?).ok()?;
        let line = text.lines().filter_map(|l| l.split_once('\t')).find(|l| l.1 == key)?;
        Some(line.0.to_string())
    }

    fn write(&self, key: &str, what: &str) -> String {
        self.written(key).unwrap_or_else(|| {
            self.append(&format!("{what}\t{key}\n"));
            self.written(key).unwrap_or_else(|| what.to_string())
        })
    }
}

impl Machine {
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

    fn at(file: Option<PathBuf>) -> Machine {
        Machine { begun: Instant::now(), file }
    }

    #[test]
    fn the_first_choice_of_a_key_stays() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let machine = || at(Some(folder.path().join("deep").join(FILE)));
        assert_eq!(machine().written("a"), None);
        assert_eq!(machine().write("a", "free"), "free");
        assert_eq!(machine().write("b", "csr"), "csr");
        // A process that measured otherwise does as the first did.
        assert_eq!(machine().write("a", "csr"), "free");
        assert_eq!(["a", "b"].map(|key| machine().written(key)), ["free", "csr"].map(|what| Some(what.to_string())));
    }

    #[test]
    fn files_that_are_none_do_no_harm() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let file = folder.path().join("choices");
        std::fs::write(&file, "nonsense\nfast\ta\n").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(at(Some(file.clone())).written("b"), None);
        // No folder can be where a file is; and there may be no place at all.
        for machine in [at(Some(file.join("below"))), at(None)] {
            assert_eq!(machine.write("a", "free"), "free");
            assert_eq!(machine.written("a"), None);
        }
    }

    #[test]
    fn its_clock_runs_on() {
        let machine = at(None);
        let (first, second) = (machine.seconds(), machine.seconds());
        assert!(first.is_some() && first <= second, "{first:?} {second:?}");
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
