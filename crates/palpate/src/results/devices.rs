//! What `palpate inspect --devices --json` prints: the graphics adapters of this machine.

use super::Document;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Graphics adapters (`devices/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DevicesDocument {
    /// The adapters, the preferred one first.
    pub devices: Vec<Device>,
}

impl Document for DevicesDocument {
    const FORMAT: &'static str = "devices/1";
}

/// An adapter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// Its number in the list, from 0, by which `PALPATE_ADAPTER` can choose it.
    pub index: usize,
    /// Its place on the PCI bus, likewise; `None` where the driver names none.
    pub pci: Option<String>,
    /// The driver's name of it.
    pub name: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU`, `software` or `other`.
    pub kind: String,
    /// Graphics interface.
    pub api: String,
    /// True where it runs every kernel.
    pub usable: bool,
    /// The same in words, with the reason.
    pub verdict: String,
    /// True where lanes of a cell can talk through subgroups.
    pub subgroups: bool,
    /// True where passes can be timed.
    pub timestamps: bool,
    /// Limits that decide how large a body and batch may be, by their name in WebGPU; sizes in bytes.
    pub limits: BTreeMap<String, u64>,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_list_of_devices_is_what_it_was_when_it_is_read_again() {
        let device = Device {
            index: 0,
            pci: Some("0000:01:00.0".into()),
            name: "llvmpipe".into(),
            kind: "software".into(),
            api: "Vulkan".into(),
            usable: true,
            verdict: "runs every kernel".into(),
            subgroups: true,
            timestamps: false,
            limits: [("max_buffer_size".to_string(), u64::from(u32::MAX))].into(),
        };
        let file = round_trip(&DevicesDocument { devices: vec![device] });
        let all = ["api", "index", "kind", "limits", "name", "pci", "subgroups", "timestamps", "usable", "verdict"];
        assert_eq!(keys(&file["devices"][0]), all);
    }
}
