//! How much memory this process may still take: what the machine has, what its container allows, what `ulimit` allows.

use std::fmt;
use std::path::{Path, PathBuf};

/// Memory that is left, and who sets the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// So much [B].
    pub bytes: u64,
    /// Who says so: the machine, its container, or the shell.
    pub by: &'static str,
}

impl fmt::Display for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of memory are left ({})", gigabytes(self.bytes), self.by)
    }
}

/// A size as people read it.
pub fn gigabytes(bytes: u64) -> String {
    let b = bytes as f64;
    if b < 9.95e8 { format!("{:.0} MB", b * 1e-6) } else { format!("{:.1} GB", b * 1e-9) }
}

/// The least of what the machine, the container (cgroup) and `ulimit` leave to this process; `None` where the system does not say.
pub fn available() -> Option<Room> {
    let all = [
        (machine(), "free on this machine"),
        (container(Path::new("/sys/fs/cgroup"), &text("/proc/self/cgroup")), "limit of the container"),
        (shell(), "limit of the shell, ulimit"),
    ];
    all.into_iter().filter_map(|(bytes, by)| Some(Room { bytes: bytes?, by })).min_by_key(|r| r.bytes)
}

fn text(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(path).unwrap_or_default()
}

/// The number behind a label at the beginning of a line.
fn labelled(text: &str, label: &str) -> Option<u64> {
    text.lines().find_map(|l| l.strip_prefix(label)?.split_whitespace().next()?.parse().ok())
}

fn machine() -> Option<u64> {
    Some(1024 * labelled(&text("/proc/meminfo"), "MemAvailable:")?)
}

/// What the control group of this process, and those above it, leave; `own` is `/proc/self/cgroup`. The cache of files can be given back.
fn container(root: &Path, own: &str) -> Option<u64> {
    let number = |path: PathBuf| text(path).trim().parse::<u64>().ok();
    let left = |folder: &Path, [limit, used, cache]: [&str; 3]| {
        let limit = number(folder.join(limit))?;
        let cache = labelled(&text(folder.join("memory.stat")), cache).unwrap_or(0);
        Some(limit.saturating_sub(number(folder.join(used))?.saturating_sub(cache)))
    };
    let up = |from: PathBuf, top: &Path| {
        let top = top.to_path_buf();
        from.ancestors().map(Path::to_path_buf).take_while(|f| f.starts_with(&top)).collect::<Vec<_>>()
    };
    let mut all = Vec::new();
    for line in own.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(kinds), Some(path)) = (parts.next(), parts.next()) else { continue };
        let path = path.trim_start_matches('/');
        if kinds.is_empty() {
            let files = ["memory.max", "memory.current", "inactive_file "];
            all.extend(up(root.join(path), root).iter().filter_map(|f| left(f, files)));
        } else if kinds.split(',').any(|k| k == "memory") {
            let files = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "];
            let root = root.join("memory");
            all.extend(up(root.join(path), &root).iter().filter_map(|f| left(f, files)));
        }
    }
    all.into_iter().min()
}

/// What `ulimit -v` and `ulimit -d` leave.
#[cfg(unix)]
fn shell() -> Option<u64> {
    use rustix::process::{Resource, getrlimit};
    let status = text("/proc/self/status");
    let left = |what, used| {
        let limit = getrlimit(what).current?;
        Some(limit.saturating_sub(1024 * labelled(&status, used)?))
    };
    [left(Resource::As, "VmSize:"), left(Resource::Data, "VmData:")].into_iter().flatten().min()
}

#[cfg(not(unix))]
fn shell() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_limit_of_a_container_counts() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let write = |name: &str, content: &str| {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        };
        write("a/memory.max", "1000\n");
        write("a/memory.current", "700\n");
        write("a/memory.stat", "anon 5\ninactive_file 200\n");
        write("a/b/memory.max", "max\n");
        write("a/b/memory.current", "100\n");
        // 1000 allowed above, 700 taken, of which 200 can be given back.
        assert_eq!(container(root, "0::/a/b\n"), Some(500));
        write("a/b/memory.max", "300\n");
        assert_eq!(container(root, "0::/a/b\n"), Some(200));
        assert_eq!(container(root, "0::/\n"), None, "no limit at the top");
        write("memory/c/memory.limit_in_bytes", "9000");
        write("memory/c/memory.usage_in_bytes", "10000");
        assert_eq!(container(root, "5:cpu,memory:/c\n"), Some(0));
        assert_eq!(container(root, "nonsense"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_says_what_is_left() {
        let room = available().unwrap();
        assert!(room.bytes > 1_000_000, "{room}");
        assert_eq!(Room { bytes: 1_234_000_000, by: "x" }.to_string(), "1.2 GB of memory are left (x)");
        assert_eq!(gigabytes(45_600_000), "46 MB");
    }
}
