//! What `palpate observe --json` prints.

use super::Document;
use serde::{Deserialize, Serialize};

/// What was recorded of a simulation (`observation/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObservationDocument {
    /// Folder of the recording.
    pub recording: String,
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// Number of cameras.
    pub cameras: usize,
    /// Number of times at which something was read.
    pub frames: usize,
    /// Depth images.
    pub images: usize,
    /// Pixels with a reading, in all images.
    pub depth_readings: usize,
    /// Readings of markers.
    pub marker_readings: usize,
    /// Readings of tracked points.
    #[serde(default)]
    pub tracked_readings: usize,
    /// Displacements of nodes.
    #[serde(default)]
    pub displacements: usize,
}

impl Document for ObservationDocument {
    const FORMAT: &'static str = "observation/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn an_observation_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&ObservationDocument {
            recording: "seen".into(),
            backend: "cpu".into(),
            cameras: 1,
            frames: 17,
            images: 17,
            depth_readings: 4000,
            marker_readings: 0,
            tracked_readings: 30,
            displacements: 0,
        });
        let all = [
            "backend",
            "cameras",
            "depth_readings",
            "displacements",
            "format",
            "frames",
            "images",
            "marker_readings",
            "recording",
            "tracked_readings",
        ];
        assert_eq!(keys(&file), all);
    }
}
