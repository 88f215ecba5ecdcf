//! How much memory this process may still take: what the machine has, what its container allows, what `ulimit` allows.

use std::fmt;
use std::path::{Path, PathBuf};

/// Addresses that a thread reserves at its first allocation [B], with glibc, which lets at most [`ARENAS`] threads a core do so. `ulimit -v`
/// counts addresses.
const ARENA: u64 = 1 << 26;
/// See [`ARENA`].
const ARENAS: usize = 8;

/// Threads that help the main one, and have just been started.
#[cfg(unix)]
const HELPERS: u64 = 2;

/// The last cache of a processor that does not say how large it is [B].
const CACHE: u64 = 1 << 25;

/// Memory that is left, and who sets the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// So much [B].
    pub bytes: u64,
    /// Who says so: the machine, its container, or the shell.
    pub by: &'static str,
    /// Whether addresses count that nothing is kept at ([`Room::beside`]).
    pub addresses: bool,
    /// So much more is left, but threads reserve it [B].
    pub reserved: u64,
}

impl fmt::Display for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of memory are left ({}", gigabytes(self.bytes), self.by)?;
        if self.reserved > 0 {
            write!(f, ", beside {} that threads reserve", gigabytes(self.reserved))?;
        }
        write!(f, ")")
    }
}

/// A size as people read it.
pub fn gigabytes(bytes: u64) -> String {
    let b = bytes as f64;
    if b < 9.95e8 { format!("{:.0} MB", b * 1e-6) } else { format!("{:.1} GB", b * 1e-9) }
}

/// The least of what the machine, the container (cgroup) and `ulimit` leave to this process; `None` where the system does not say.
pub fn available() -> Option<Room> {
    let [data, addresses] = shell();
    let all = [
        (machine(), "free on this machine", false),
        (container(Path::new("/sys/fs/cgroup"), &text("/proc/self/cgroup")), "limit of the container", false),
        (data, "limit of the shell, ulimit -d", false),
        (addresses, "limit of the shell, ulimit -v", true),
    ];
    all.into_iter()
        .filter_map(|(bytes, by, addresses)| Some(Room { bytes: bytes?, by, addresses, reserved: 0 }))
        .min_by_key(|r| r.bytes)
}

impl Room {
    /// What is left beside the addresses that threads reserve and use little of: so many that are yet to be started, and so many that compute, at
    /// their first product of matrices. Each of the latter keeps twice the last cache to pack them in. Only `ulimit -v` counts that.
    pub fn beside(self, started: usize, computing: usize) -> Room {
        if !self.addresses {
            return self;
        }
        let said = text("/sys/devices/system/cpu/cpu0/cache/index3/size");
        let cache = said.trim().strip_suffix('K').and_then(|k| k.parse::<u64>().ok()).map_or(CACHE, |k| 1024 * k);
        let arenas = started.min(ARENAS * std::thread::available_parallelism().map_or(1, usize::from));
        let reserved = arenas as u64 * ARENA + computing as u64 * 2 * cache;
        Room { bytes: self.bytes.saturating_sub(reserved), reserved, ..self }
    }
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

/// What `ulimit -d` and `ulimit -v` leave.
#[cfg(unix)]
fn shell() -> [Option<u64>; 2] {
    use rustix::process::{Resource, getrlimit};
    let status = text("/proc/self/status");
    let left = |what, used, reserved| {
        let limit = getrlimit(what).current?;
        Some(limit.saturating_sub(1024 * labelled(&status, used)? + reserved))
    };
    [left(Resource::Data, "VmData:", 0), left(Resource::As, "VmSize:", HELPERS * ARENA)]
}

#[cfg(not(unix))]
fn shell() -> [Option<u64>; 2] {
    [None; 2]
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
        let of = |addresses| Room { bytes: 1 << 40, by: "x", addresses, reserved: 0 };
        assert_eq!(of(false).beside(9, 9), of(false));
        let taken = |started, computing| (1 << 40) - of(true).beside(started, computing).bytes;
        assert!(taken(0, 2) == 2 * taken(0, 1) && taken(0, 1) > 0);
        // However many are started.
        assert!(taken(1, 1) > taken(0, 1) && taken(1_000_000, 0) == taken(2_000_000, 0));
        let room = Room { bytes: 1_234_000_000, ..of(false) };
        assert_eq!(room.to_string(), "1.2 GB of memory are left (x)");
        let room = Room { reserved: 45_600_000, ..room };
        assert_eq!(room.to_string(), "1.2 GB of memory are left (x, beside 46 MB that threads reserve)");
        assert_eq!(gigabytes(45_600_000), "46 MB");
    }
}
