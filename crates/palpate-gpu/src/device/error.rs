//! What can go wrong with a device: one clear error each, with the way out.

use super::adapters::Choice;

/// A device that cannot be had, cannot do the work, or broke.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GpuError {
    /// No driver offers an adapter, or none is what was asked for.
    #[error("no graphics adapter {}(found: {})", asked(.wanted), list(.found))]
    NoAdapter {
        /// What was asked for.
        wanted: Choice,
        /// What there is: index, name and PCI address.
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
    #[error("{adapter} is too small: a kernel needs {needed}{0}, and its limit {limit} is {available}{0}", unit(.limit))]
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
    #[error("{what} needs {needed}{0}, and the limit {limit} of this device is {available}{0}", unit(.limit))]
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
    /// Something is to be timed, and the device was opened by a host without a clock.
    #[error("nothing can be timed: the device was opened without a clock")]
    NoClock,
    /// The plan holds something that this backend cannot compute.
    #[error("the GPU backend does not support {what}")]
    Plan {
        /// What.
        what: String,
    },
}

/// What follows a number of this limit.
fn unit(limit: &str) -> &'static str {
    match limit {
        "max_storage_buffer_binding_size" | "max_buffer_size" | "max_compute_workgroup_storage_size" => " bytes",
        _ => "",
    }
}

/// What wgpu and the drivers behind it say of full memory: not only in errors of that kind, and in none of the others.
const FULL: [&str; 5] =
    ["not enough memory", "out of memory", "out of device memory", "out of host memory", "memory allocation has failed"];

/// What was asked for, with a blank behind it.
fn asked(wanted: &Choice) -> String {
    if *wanted == Choice::Auto { String::new() } else { format!("{wanted} ") }
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

impl GpuError {
    /// An operation that the driver refuses in these words; for want of memory, where they say so.
    pub(crate) fn refused(message: String) -> GpuError {
        let words = message.to_lowercase().replace('_', " ");
        if FULL.iter().any(|f| words.contains(f)) {
            GpuError::OutOfMemory { what: message }
        } else {
            GpuError::Refused { message }
        }
    }

    /// What a user can do.
    pub fn hint(&self) -> String {
        self.hint_for(false)
    }

    /// The same where one simulation runs, so that no batch can be smaller.
    pub fn hint_alone(&self) -> String {
        self.hint_for(true)
    }

    pub(crate) fn hint_for(&self, alone: bool) -> String {
        let hint = match self {
            GpuError::NoAdapter { found, .. } if !found.is_empty() => {
                return format!(
                    "set PALPATE_ADAPTER to an index, a PCI address or a part of a name found ({}), unset it, or use --backend cpu",
                    found.join(", ")
                );
            }
            GpuError::NoAdapter { .. } => "install a Vulkan driver (Debian: mesa-vulkan-drivers), or use --backend cpu",
            GpuError::Unsupported { .. }
            | GpuError::TooSmall { .. }
            | GpuError::Shader { .. }
            | GpuError::Refused { .. }
            | GpuError::Plan { .. } => "use --backend cpu, or another adapter",
            GpuError::NoClock => "open the device for a host that has one",
            GpuError::Setting { .. } => "unset the variable, and what is faster is chosen",
            GpuError::Limit { .. } if alone => "use coarser cells, or --backend cpu",
            GpuError::Limit { .. } => "use coarser cells, a smaller batch (--batch N), or --backend cpu",
            GpuError::OutOfMemory { .. } if alone => "free memory, or use coarser cells or --backend cpu",
            GpuError::OutOfMemory { .. } => "free memory, or use coarser cells, a smaller batch (--batch N), or --backend cpu",
            GpuError::Lost { .. } if alone => "run again, or use --backend cpu",
            // Drivers also drop a device whose memory is full.
            GpuError::Lost { .. } => "run again, with a smaller batch (--batch N) or --backend cpu; results so far are kept",
        };
        hint.into()
    }
}

/// wgpu's error as ours.
pub(crate) fn translate(e: wgpu::Error) -> GpuError {
    // Its words are spread over indented lines.
    let flat = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    match e {
        wgpu::Error::OutOfMemory { source } => GpuError::OutOfMemory { what: flat(source.to_string()) },
        // Whatever is asked of a device that is gone is refused so.
        wgpu::Error::Validation { description, .. } if description.contains("device is lost") => {
            GpuError::Lost { reason: flat(description) }
        }
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            GpuError::refused(flat(description))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_memory_is_recognised_in_whatever_words_it_comes() {
        for words in [
            "Not enough memory left.",
            "In Device::create_bind_group, label = 'press_cells' Out of Memory",
            "ERROR_OUT_OF_DEVICE_MEMORY",
            "A host memory allocation has failed",
        ] {
            let e = GpuError::refused(words.into());
            assert!(matches!(&e, GpuError::OutOfMemory { what } if what == words), "{e}");
            assert!(
                ["memory", "coarser cells", "--batch N", "--backend cpu"].iter().all(|w| e.hint().contains(w)),
                "{}",
                e.hint()
            );
        }
        let other = "workgroup memory of 20000 bytes is more than the limit";
        assert_eq!(GpuError::refused(other.into()), GpuError::Refused { message: other.into() });
    }

    #[test]
    fn sizes_have_units_and_a_single_simulation_is_told_of_no_batch() {
        let limit = |limit| GpuError::Limit { limit, available: 999, needed: 1000, what: "the buffer `values`".into() };
        let text = limit("max_buffer_size").to_string();
        assert_eq!(text, "the buffer `values` needs 1000 bytes, and the limit max_buffer_size of this device is 999 bytes");
        assert!(limit("members").to_string().ends_with("needs 1000, and the limit members of this device is 999"));
        let (what, reason) = ("full".to_string(), "gone".to_string());
        for e in [limit("max_buffer_size"), GpuError::OutOfMemory { what }, GpuError::Lost { reason }] {
            assert!(e.hint().contains("--batch N") && e.hint().contains("--backend cpu"), "{}", e.hint());
            assert!(!e.hint_alone().contains("batch") && e.hint_alone().contains("--backend cpu"), "{}", e.hint_alone());
        }
    }
}
