//! Options that several commands share.

use crate::engine::Backend;
use crate::error::Error;
use crate::memory::Demand;
use crate::progress::{Liveliness, Track};
use clap::{Args, ValueEnum};
use palpate_model::plan::Plan;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// What `--backend` may say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BackendName {
    /// Reference in double precision
    Cpu,
    /// WGSL kernels on a graphics adapter (PALPATE_ADAPTER chooses one by index, PCI address or name)
    Gpu,
    /// The faster one, as measured
    Auto,
}

impl BackendName {
    /// The backend, left open where it is `auto`.
    fn backend(self) -> Backend {
        match self {
            BackendName::Cpu => Backend::Cpu,
            BackendName::Gpu => Backend::Gpu,
            BackendName::Auto => Backend::Auto,
        }
    }

    /// The backend for a plan in batches of `members`, and a line about the choice where it was left open; the track shows what takes time.
    ///
    /// # Errors
    /// The GPU was asked for and there is no usable adapter.
    pub fn choose(self, plan: &Plan, members: usize, track: &mut Track) -> Result<(Backend, Option<String>), Error> {
        self.choose_for(plan, &Demand::forward(members), track)
    }

    /// The same for a fit.
    ///
    /// # Errors
    /// As [`BackendName::choose`].
    pub(crate) fn choose_for(self, plan: &Plan, demand: &Demand, track: &mut Track) -> Result<(Backend, Option<String>), Error> {
        let asked = self.backend();
        if asked == Backend::Gpu {
            track.on(0, "opening the graphics device");
        }
        asked.check()?;
        let (backend, reason) = asked.resolve_for(plan, demand, &mut |what| track.on(0, what));
        Ok((backend, (asked == Backend::Auto).then(|| format!("backend: {} (auto: {reason})", backend.name()))))
    }
}

/// Options of every command.
#[derive(Clone, Copy, Debug, Args)]
pub struct Talk {
    /// Print the result as JSON on stdout
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress and no notes on stderr; warnings and errors remain
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Progress on stderr [default: bar on a terminal, lines otherwise]
    #[arg(long, global = true, value_enum, value_name = "HOW")]
    pub progress: Option<Liveliness>,
    /// Progress, notes, warnings, errors and how long each stage took as events on stderr, one a line [default: words for people]
    #[arg(long, global = true, value_enum, value_name = "FORM", conflicts_with = "progress")]
    pub log: Option<Log>,
}

/// What events look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Log {
    /// Time, kind and words
    Text,
    /// A JSON object a line: time, kind (progress, note, warning, error, stage), message, and seconds or code where there are such
    Json,
}

/// Reads a whole number in a range, and says which are allowed where it is none of them. Clap by itself takes a negative number for an
/// option that it does not know, and a word for a wrong digit.
pub fn count(allowed: RangeInclusive<u64>) -> impl Fn(&str) -> Result<u64, String> + Clone + Send + Sync + 'static {
    move |text| match text.parse() {
        Ok(n) if allowed.contains(&n) => Ok(n),
        _ if *allowed.end() == u64::MAX => Err(format!("must be a whole number from {}", allowed.start())),
        _ => Err(format!("must be a whole number from {} to {}", allowed.start(), allowed.end())),
    }
}

/// Name of a scene without folder and ending.
pub fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned())
}

/// The output folder: what was asked for, or `out/NAME`.
pub fn out_folder(asked: &Option<PathBuf>, scene: &Path, suffix: &str) -> PathBuf {
    asked.clone().unwrap_or_else(|| Path::new("out").join(format!("{}{suffix}", stem(scene))))
}
