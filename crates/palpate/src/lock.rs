//! One process a folder: a file in it that says who writes there, and in which a heart beats.
//!
//! A lock is dead once nothing in it has changed for the time T that it states, by the clock of whoever watches it: clocks of two hosts are never
//! compared. Its holder beats every T/6, and gives up by itself where it could not for T. A watcher on the same host need not wait: it asks
//! whether the process is there.

use crate::error::Error;
use crate::interrupt::{Clock, Interrupt};
use crate::results::lock::LockDocument;
use crate::results::{self, Document};
use std::fs::{self, File};
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// The file in a folder that is written into.
pub const NAME: &str = "palpate.lock";
/// T: how long the heart of a living process may be still. A look opens the file, at which NFS asks its server, so that caches of attributes,
/// which may be a minute old, do not hide a beat.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Beats in that time: five may be lost.
const BEATS: u32 = 6;
/// How often a watcher looks.
const LOOK: Duration = Duration::from_millis(200);

/// What came of the wish for a lock.
pub enum Taken {
    /// It is this process's.
    Mine(Lock),
    /// It is another's, as far as is known.
    Held(Held),
}

/// A lock of this process; it is released with its owner.
pub struct Lock {
    path: PathBuf,
    token: String,
    lost: Arc<AtomicBool>,
    heart: Option<(Sender<()>, JoinHandle<()>)>,
}

/// Name of this machine.
fn host() -> String {
    #[cfg(unix)]
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    #[cfg(not(unix))]
    let name = std::env::var("COMPUTERNAME").unwrap_or_default();
    name
}

/// Which kernel numbers the processes, and in which namespace: two containers count theirs from 1. Empty where the system does not say.
fn namespace() -> String {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    let space = fs::read_link("/proc/self/ns/pid").unwrap_or_default();
    if boot.is_empty() || space.as_os_str().is_empty() { String::new() } else { format!("{} {}", boot.trim(), space.display()) }
}

/// When a process began, in ticks since the machine did; tells it from a later one with the same number.
fn beginning(process: u32) -> Option<u64> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name in brackets may hold anything; the beginning is the 20th number behind it.
    text.rsplit_once(')')?.1.split_whitespace().nth(19)?.parse().ok()
}

/// False where no process of this number is there.
fn exists(process: u32) -> bool {
    #[cfg(unix)]
    let there = i32::try_from(process)
        .ok()
        .and_then(rustix::process::Pid::from_raw)
        .is_none_or(|pid| rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH));
    #[cfg(not(unix))]
    let there = process > 0;
    there
}

/// Something that no other process says.
fn token(host: &str) -> String {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    format!("{host}-{}-{}-{}", std::process::id(), now.as_nanos(), COUNT.fetch_add(1, Ordering::Relaxed))
}

fn beat(count: u64) -> String {
    format!("{count:010}")
}

fn content(path: &Path) -> io::Result<Option<String>> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}

/// Whether the lock at a path is still the one with this token.
fn holds(path: &Path, token: &str) -> io::Result<bool> {
    Ok(content(path)?.is_some_and(|text| text.contains(&format!("\"{token}\""))))
}

impl Lock {
    /// Takes the lock of a folder. One whose process is known to have ended is removed; what another process may hold is not waited for.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn take(folder: &Path, patience: Duration) -> Result<Taken, Error> {
        let path = folder.join(NAME);
        Lock::take_at(&path, patience).map_err(|e| Error::write(&path, e))
    }

    fn take_at(path: &Path, patience: Duration) -> io::Result<Taken> {
        loop {
            match Lock::create(path, patience) {
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                done => return done.map(Taken::Mine),
            }
            // It may have been released between the two looks.
            let Some(held) = Held::look(path)? else { continue };
            if !(held.has_ended() && held.remove()?) {
                return Ok(Taken::Held(held));
            }
        }
    }

    fn create(path: &Path, patience: Duration) -> io::Result<Lock> {
        let mut file = File::options().write(true).create_new(true).open(path)?;
        let (host, process) = (host(), std::process::id());
        let document = LockDocument {
            beat: beat(0),
            token: token(&host),
            host,
            process,
            since: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            patience: patience.as_secs_f64(),
            namespace: namespace(),
            beginning: beginning(process),
        };
        let text = results::line(&document) + "\n";
        if let Err(e) = file.write_all(text.as_bytes()).and_then(|()| file.sync_all()) {
            // The first error is the one to report.
            let _ = fs::remove_file(path);
            return Err(e);
        }
        let place = text.find(&format!("\"{}\"", document.beat)).expect("it was just written") + 1;
        let (end, ended) = channel();
        let lost = Arc::new(AtomicBool::new(false));
        let heart =
            Heart { file, place: place as u64, path: path.into(), token: document.token.clone(), patience, lost: lost.clone() };
        let heart = std::thread::spawn(move || heart.beat(&ended));
        Ok(Lock { path: path.into(), token: document.token, lost, heart: Some((end, heart)) })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// An interrupt that is raised as well when the lock is lost.
    pub fn guard(&self, interrupt: &Interrupt) -> Interrupt {
        let lost = self.lost.clone();
        let clock = Clock::new(move || if lost.load(Ordering::SeqCst) { Duration::MAX } else { Duration::ZERO });
        interrupt.until(&clock, Duration::MAX)
    }

    /// True once another process has, or may have, taken it over.
    pub fn is_lost(&self) -> bool {
        // A file that cannot be read now may be readable later; the heart decides that.
        if matches!(holds(&self.path, &self.token), Ok(false)) {
            self.lost.store(true, Ordering::SeqCst);
        }
        self.lost.load(Ordering::SeqCst)
    }

    /// An error once it is lost: nothing may be written any more.
    pub fn check(&self) -> Result<(), Error> {
        if self.is_lost() { Err(Error::Failed(self.loss())) } else { Ok(()) }
    }

    /// What is said of a lock that was lost.
    pub fn loss(&self) -> String {
        let by =
            Held::look(&self.path).ok().flatten().map_or("somebody removed its lock".into(), |h| format!("{h} took it over"));
        format!("this process was still for too long, and {by}; nothing more was written")
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Some((end, heart)) = self.heart.take() {
            drop(end);
            // It only beats; how it ended is in `lost`.
            let _ = heart.join();
        }
        if !self.is_lost() {
            // One that stays is taken for dead once its process has ended.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// What shows others that the holder lives.
struct Heart {
    file: File,
    /// Where the number of beats stands in the file.
    place: u64,
    path: PathBuf,
    token: String,
    patience: Duration,
    lost: Arc<AtomicBool>,
}

impl Heart {
    fn beat(mut self, end: &Receiver<()>) {
        let mut last = Instant::now();
        for count in 1.. {
            if end.recv_timeout(self.patience / BEATS) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            // Into the file that this process made, wherever it is by now: a lock of another is not touched.
            let place = self.file.seek(SeekFrom::Start(self.place));
            let beaten = place.and_then(|_| self.file.write_all(beat(count).as_bytes())).and_then(|()| self.file.sync_data());
            match (beaten, holds(&self.path, &self.token)) {
                (Ok(()), Ok(true)) => last = Instant::now(),
                (_, Ok(false)) => self.lost.store(true, Ordering::SeqCst),
                // Whoever watches has seen nothing for as long.
                _ if last.elapsed() >= self.patience => self.lost.store(true, Ordering::SeqCst),
                _ => {}
            }
            if self.lost.load(Ordering::SeqCst) {
                return;
            }
        }
    }
}

/// A lock of another process, as it was when it was looked at.
#[derive(Clone, Debug)]
pub struct Held {
    path: PathBuf,
    text: String,
    /// `None` where it cannot be read: it is being written, or of another version.
    holder: Option<Box<LockDocument>>,
}

impl Held {
    /// Looks at a lock; `None` where there is none.
    pub fn look(path: &Path) -> io::Result<Option<Held>> {
        let held = |text: String| Held { path: path.into(), holder: results::parse(&text, path).ok().map(Box::new), text };
        Ok(content(path)?.map(held))
    }

    /// The time that it states.
    fn patience(&self) -> Duration {
        self.holder.as_ref().and_then(|h| Duration::try_from_secs_f64(h.patience).ok()).unwrap_or(PATIENCE)
    }

    /// Whether its process is there, where this machine can know.
    fn living(&self) -> Option<bool> {
        let h = self.holder.as_ref()?;
        let here = !h.namespace.is_empty() && h.namespace == namespace() && h.host == host();
        let other = || h.beginning.is_some_and(|then| beginning(h.process).is_some_and(|now| now != then));
        here.then(|| exists(h.process) && !other())
    }

    /// True where this machine knows that its process is no more.
    pub fn has_ended(&self) -> bool {
        self.living() == Some(false)
    }

    /// True where this machine knows that its process is there.
    pub fn is_alive(&self) -> bool {
        self.living() == Some(true)
    }

    /// Waits for a sign of life, at most for the time that it states. True where it is worth trying again: it was released, or it is dead and
    /// was removed.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn watch(&self, stop: &Interrupt) -> Result<bool, Error> {
        self.watch_until(stop).map_err(|e| Error::write(&self.path, e))
    }

    fn watch_until(&self, stop: &Interrupt) -> io::Result<bool> {
        let begun = Instant::now();
        while begun.elapsed() < self.patience() {
            match Held::look(&self.path)? {
                None => return Ok(true),
                Some(now) if now.text != self.text => return Ok(false),
                Some(_) if stop.is_raised() => return Ok(false),
                Some(_) => std::thread::sleep(LOOK.min(self.patience())),
            }
        }
        self.remove()
    }

    /// Removes it, unless something has changed since it was looked at. True where it is gone.
    fn remove(&self) -> io::Result<bool> {
        let same = |path: &Path| Ok::<_, io::Error>(content(path)?.is_some_and(|text| text == self.text));
        if !same(&self.path)? {
            return Ok(false);
        }
        // Of several watchers one moves it; who comes later finds nothing, or a living lock, which goes back.
        let aside = self.path.with_file_name(format!(".{NAME}.{}", token(&host())));
        match fs::rename(&self.path, &aside) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(true),
            done => done?,
        }
        if same(&aside)? {
            fs::remove_file(&aside)?;
            return Ok(true);
        }
        fs::rename(&aside, &self.path)?;
        Ok(false)
    }
}

/// Who holds it: `process 4242 on node7, since 2026-01-31T12:00:00Z,`.
impl std::fmt::Display for Held {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.holder {
            Some(h) => write!(f, "process {} on {} (since {})", h.process, h.host, h.since),
            None => write!(f, "whoever made {} (it is not {})", self.path.display(), LockDocument::FORMAT),
        }
    }
}

#[cfg(test)]
#[path = "lock_tests.rs"]
mod tests;
