//! What can go wrong with a device: one clear error each, with the way out.

use palpate_engine::BuildError;

/// A device that cannot be had, cannot do the work, or broke.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter, or none of the wanted name.
    #[error("no graphics adapter {}(found: {})", .wanted.as_ref().map_or(String::new(), |w| format!("with {w:?} in its name ")), list(.found))]
    NoAdapter {
        /// Part of a name that was asked for.
        wanted: Option<String>,
        /// Names of what there is.
        found: Vec<String>,
    },
    /// The adapter lacks a feature.
    #[error("{adapter} does not support {feature}")]
    Unsupported {
        /// Its name.
        adapter: String,
        /// What is missing.
        feature: String,
    },
    /// The adapter is too small for some kernel, whatever the body.
    #[error("{adapter} is too small: a kernel needs {needed}, and its limit {limit} is {available}")]
    TooSmall {
        /// Its name.
        adapter: String,
        /// Name of the limit.
        limit: &'static str,
        /// Its value.
        available: u64,
        /// What is needed.
        needed: u64,
    },
    /// A limit of the device is too small.
    #[error("{what} needs {needed}, and the limit {limit} of this device is {available}")]
    Limit {
        /// Name of the limit.
        limit: &'static str,
        /// Its value.
        available: u64,
        /// What is needed.
        needed: u64,
        /// By what.
        what: String,
    },
    /// The device's memory is full.
    #[error("the device is out of memory ({what})")]
    OutOfMemory {
        /// Details from the driver.
        what: String,
    },
    /// The device went away.
    #[error("the device was lost: {reason}")]
    Lost {
        /// Details from the driver.
        reason: String,
    },
    /// The driver refuses a kernel.
    #[error("the kernel {pass} does not compile on this device: {message}")]
    Shader {
        /// Name of the pass.
        pass: String,
        /// The driver's words.
        message: String,
    },
    /// The driver refuses an operation.
    #[error("the device refuses an operation: {message}")]
    Refused {
        /// The driver's words.
        message: String,
    },
    /// An environment variable says something else than it may.
    #[error("{name} = {value:?}; allowed: {allowed}")]
    Setting {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        allowed: &'static str,
    },
    /// The plan holds something that this backend cannot compute.
    #[error("the GPU backend does not support {what}")]
    Plan {
        /// What.
        what: String,
    },
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

impl GpuError {
    /// What a user can do.
    pub fn hint(&self) -> String {
        let hint = match self {
            GpuError::NoAdapter { found, .. } if !found.is_empty() => {
                return format!(
                    "set PALPATE_ADAPTER to part of a name found ({}), unset it, or use --backend cpu",
                    found.join(", ")
                );
            }
            GpuError::NoAdapter { .. } => "install a Vulkan driver (Debian: mesa-vulkan-drivers), or use --backend cpu",
            GpuError::Unsupported { .. }
            | GpuError::TooSmall { .. }
            | GpuError::Shader { .. }
            | GpuError::Refused { .. }
            | GpuError::Plan { .. } => "use --backend cpu, or another adapter",
            GpuError::Setting { .. } => "unset the variable, and what is faster is chosen",
            GpuError::Limit { .. } | GpuError::OutOfMemory { .. } => {
                "use coarser cells, a smaller batch (--batch N), or --backend cpu"
            }
            // Drivers also drop a device whose memory is full.
            GpuError::Lost { .. } => "run again, with a smaller batch (--batch N) or --backend cpu; results so far are kept",
        };
        hint.into()
    }
}

impl From<GpuError> for BuildError {
    fn from(e: GpuError) -> BuildError {
        BuildError { message: e.to_string(), hint: e.hint() }
    }
}
