//! The folder that a command writes into: it can be made, and no other process writes into it meanwhile.

use crate::cli::Console;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::lock::{self, Held, Lock, PATIENCE, Taken};
use crate::progress::Track;
use palpate_io::output::make_folder;
use std::path::Path;

/// Says before anything takes time what would keep a command from writing into a folder: it is a file, or another process has it. Nothing is
/// made; [`take`] decides.
///
/// # Errors
/// [`Error::Option`] about `--out`.
pub(crate) fn check(folder: &Path) -> Result<(), Error> {
    let there = folder.ancestors().find(|f| f.exists());
    if let Some(file) = there.filter(|f| !f.is_dir()) {
        let which = if file == folder { String::new() } else { format!("{} ", file.display()) };
        return Err(Error::option("out", folder.display(), format!("{which}is a file; give a folder")));
    }
    match Held::look(&folder.join(lock::NAME)) {
        Ok(Some(held)) if held.is_alive() => Err(taken(folder, &held)),
        _ => Ok(()),
    }
}

fn taken(folder: &Path, held: &Held) -> Error {
    let message = format!("{held} writes into it; wait until that has ended, or give another folder");
    Error::option("out", folder.display(), message)
}

/// How a command of one scene begins: nothing is in its way, the scene is read and its warnings are told, the folder is its own, and from then on
/// an interrupt is served, and is one as well where another process has taken the folder.
///
/// # Errors
/// As [`check`] and [`take`], or what `read` says.
pub(crate) fn begin(
    folder: &Path,
    what: &str,
    console: &mut Console,
    read: impl FnOnce() -> Result<Experiment, Error>,
) -> Result<(Experiment, Track, Lock), Error> {
    check(folder)?;
    let mut track = console.progress(0, what);
    track.on(0, "reading");
    let experiment = read()?;
    track.aside(|| console.warn(experiment.warnings()));
    let lock = take(folder, console)?;
    console.interrupt.serve();
    console.interrupt = lock.guard(&console.interrupt);
    Ok((experiment, track, lock))
}

/// Makes a folder and takes its lock, which is released with the value. Of a process that this machine cannot ask for, a sign of life is
/// waited for.
///
/// # Errors
/// [`Error::Option`] where another process has it, [`Error::Output`] where it cannot be made.
pub(crate) fn take(folder: &Path, console: &mut Console) -> Result<Lock, Error> {
    check(folder)?;
    make_folder(folder)?;
    loop {
        let held = match Lock::take(folder, PATIENCE)? {
            Taken::Mine(lock) => return Ok(lock),
            Taken::Held(held) => held,
        };
        if !held.is_alive() {
            console.note(&format!("{}: waiting for a sign of life of {held}", folder.display()));
            if held.watch(&console.interrupt)? {
                continue;
            }
        }
        return Err(taken(folder, &held));
    }
}
