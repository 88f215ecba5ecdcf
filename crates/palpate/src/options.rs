//! Options that several commands share.

use crate::engine::Backend;
use crate::error::Error;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// What `--backend` may say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BackendName {
    /// Reference in double precision
    Cpu,
    /// Not in this build
    Gpu,
    /// The fastest available
    Auto,
}

impl BackendName {
    /// The backend, and a line about the choice where it was left open.
    pub fn choose(self) -> Result<(Backend, Option<String>), Error> {
        match self {
            BackendName::Cpu => Ok((Backend::Cpu, None)),
            BackendName::Auto => Ok((Backend::Auto, Some(format!("backend: {} (auto)", Backend::Auto.resolved())))),
            BackendName::Gpu => {
                Err(Error::Input("--backend gpu: this build has only the cpu backend; allowed are cpu and auto".into()))
            }
        }
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
}

/// Name of a scene without folder and ending.
pub fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned())
}

/// The output folder: what was asked for, or `out/NAME`.
pub fn out_folder(asked: &Option<PathBuf>, scene: &Path, suffix: &str) -> PathBuf {
    asked.clone().unwrap_or_else(|| Path::new("out").join(format!("{}{suffix}", stem(scene))))
}
