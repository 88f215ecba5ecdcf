//! What `palpate inspect --json` prints of a scene or a recording.

use super::Document;
use serde::{Deserialize, Serialize};

/// What a scene or a recording holds (`inspection/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InspectionDocument {
    /// Its file or folder.
    pub path: String,
    /// What looks wrong, in sentences.
    pub warnings: Vec<String>,
    /// What was looked at.
    #[serde(flatten)]
    pub content: Inspected,
}

impl Document for InspectionDocument {
    const FORMAT: &'static str = "inspection/1";
}

/// What was looked at; `kind` says which.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Inspected {
    /// A scene, with its recording where it names one.
    Scene(Box<SceneInspection>),
    /// A recording.
    Recording(Box<RecordingInspection>),
}

/// A scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneInspection {
    /// Its title; absent where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Edges of the box around the rest shape [m].
    pub size: [f64; 3],
    /// Volume on the grid [m³].
    pub volume: f64,
    /// Surface on the grid [m²].
    pub area: f64,
    /// Mass on the grid [kg].
    pub mass: f64,
    /// Open edges of the mesh file, before its repair; absent for other shapes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub open_edges: Option<usize>,
    /// Edge of a cell [m]; of tetrahedra, edge of the cube that six mean ones fill.
    pub cell_size: f64,
    /// Cells of the body, or its tetrahedra, which count as full.
    pub cells: Cells,
    /// The mesh of a body of tetrahedra; absent for one of cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tetrahedra: Option<Tetrahedra>,
    /// Which discretisation suits the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub suited: Option<Suited>,
    /// Its nodes.
    pub nodes: usize,
    /// Three for every node.
    pub degrees_of_freedom: usize,
    /// Cells in which distances to the surface are known.
    pub band_cells: usize,
    /// What holds, stops and weighs it down.
    pub constraints: Constraints,
    /// When it is simulated.
    pub time: Time,
    /// Bytes that a fit takes on the CPU.
    pub memory: u64,
    /// Simulations at once on the CPU.
    pub batch: usize,
    /// Bytes that a fit takes on a graphics device; absent where no device can hold it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_memory: Option<u64>,
    /// Simulations at once there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_batch: Option<usize>,
    /// Why the device cannot run it, if it cannot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device_refusal: Option<String>,
    /// What it is compared with; absent without a recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observation: Option<Observed>,
    /// Paths of the numbers to be found; absent where nothing is fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free: Option<Vec<String>>,
    /// What the recording would determine; absent unless asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identification: Option<Identification>,
}

/// What a recording would determine, before anything is fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Identification {
    /// Scalar residuals that it is taken from.
    pub residuals: usize,
    /// Every free number, or part of a field.
    pub numbers: Vec<Expectation>,
    /// Second motions, the one that would tell most first.
    pub motions: Vec<Proposal>,
    /// Motions that could not be looked at.
    pub warnings: Vec<String>,
}

/// What is to be expected of one number, at the scene's own values and with residuals as large as the noise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expectation {
    /// Its path; of a part of a field, with where it is.
    pub path: String,
    /// The scene's value.
    pub value: f64,
    /// Expected standard error in its unit.
    pub error: f64,
    /// SI unit.
    pub unit: String,
    /// The same of its logarithm; absent of numbers that are not fitted by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
    /// False where the recording says next to nothing of it.
    pub determined: bool,
    /// Of a field with a prior: the share of the prior's variance that the recording takes away.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Numbers that it would not be told apart from.
    pub with: Vec<String>,
}

/// A second motion, watched by the same sensors.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// What would be done.
    pub motion: String,
    /// What it adds, ½ ln det(H₁ + H₂)/det(H₁) [nats].
    pub information: f64,
    /// Expected standard error of every number with both recordings, in its unit.
    pub errors: Vec<f64>,
}

/// Cells of a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cells {
    /// All.
    pub all: usize,
    /// Those that are inside as a whole.
    pub full: usize,
    /// Those that the surface cuts.
    pub cut: usize,
}

/// The mesh of a body of tetrahedra.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tetrahedra {
    /// Number of tetrahedra.
    pub count: usize,
    /// Number of nodes at their corners.
    pub corner_nodes: usize,
    /// Their volume [m³].
    pub volume: f64,
    /// Smallest and largest angle between two faces [°].
    pub dihedral_angles: [f64; 2],
    /// Named groups of nodes.
    pub groups: Vec<Group>,
    /// How they were made; absent where a file has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_here: Option<MadeHere>,
}

/// A named group of nodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Number of corner nodes in it.
    pub nodes: usize,
}

/// Tetrahedra that a shape was filled with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MadeHere {
    /// Longest edge of those inside [m].
    pub edge_length: f64,
    /// Error of the volume before the surface was moved, relative.
    pub volume_error: f64,
    /// How far the surface was moved outwards to make up for it [m].
    pub moved: f64,
}

/// Which discretisation suits a body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Suited {
    /// `cells` or `tetrahedra`.
    pub discretisation: String,
    /// Why.
    pub reason: String,
}

/// What holds, stops and weighs a body down.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constraints {
    /// Clamps.
    pub clamps: usize,
    /// Planes.
    pub planes: usize,
    /// Point masses.
    pub masses: usize,
}

/// When a scene is simulated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Time step [s].
    pub step: f64,
    /// Number of steps; 0 for a static problem.
    pub steps: usize,
    /// Time of the first state on the recording's clock [s].
    pub start: f64,
    /// Time of the last state [s].
    pub end: f64,
}

/// What a scene is compared with.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observed {
    /// Number of frames.
    pub frames: usize,
    /// Time of the first [s].
    pub from: f64,
    /// Time of the last [s].
    pub to: f64,
    /// Number of cameras.
    pub cameras: usize,
    /// Depth points of all frames.
    pub points: usize,
    /// Fewest and most of a frame.
    pub points_per_frame: [usize; 2],
    /// Readings of markers.
    pub marker_readings: usize,
    /// Number of markers.
    pub markers: usize,
    /// Readings of tracked points.
    #[serde(default)]
    pub tracked_readings: usize,
    /// Number of tracked points.
    #[serde(default)]
    pub tracked_points: usize,
    /// Displacements of nodes in all frames.
    #[serde(default)]
    pub displacements: usize,
    /// Standard deviation of a depth reading [m]; `None` where no depth is compared.
    pub depth_noise: Option<f64>,
    /// Standard deviation of a marker's coordinate [m]; `None` where no marker is compared.
    pub marker_noise: Option<f64>,
    /// Standard deviation of a tracked point's coordinate [m]; `None` where none is compared.
    #[serde(default)]
    pub tracked_noise: Option<f64>,
    /// Standard deviation of a displacement's component [m]; `None` where none is compared.
    #[serde(default)]
    pub displacement_noise: Option<f64>,
    /// True where it lies around the object; a scene of which it does not is refused.
    pub overlap: bool,
}

/// A recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordingInspection {
    /// Its title; absent where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Its cameras; absent without any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<CameraInspection>,
    /// Its depth images; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<Images>,
    /// Its point clouds; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clouds: Option<Clouds>,
    /// Its markers; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub markers: Option<Markers>,
    /// Its tracked points; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<SequenceInspection>,
    /// Its displacements of nodes; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacements: Option<SequenceInspection>,
}

/// Things that are seen again and again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SequenceInspection {
    /// How many there are.
    pub count: usize,
    /// Number of times.
    pub frames: usize,
    /// Readings of all.
    pub readings: usize,
    /// How often one was not seen.
    pub unseen: usize,
    /// First time [s].
    pub from: f64,
    /// Last time [s].
    pub to: f64,
    /// Standard deviation of a coordinate [m]; `None` where it is not stated.
    pub noise: Option<f64>,
}

/// A camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraInspection {
    /// Its name.
    pub name: String,
    /// Width of its images [pixels].
    pub width: usize,
    /// Height of its images [pixels].
    pub height: usize,
    /// Standard deviation of a reading [m]; `None` where it is not stated.
    pub noise: Option<f64>,
    /// Standard deviation of an error that all readings share [m].
    pub systematic: f64,
    /// Where it stands in the world [m].
    pub position: [f64; 3],
}

/// Point clouds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clouds {
    /// How many.
    pub count: usize,
    /// How many of them have no line of sight: neither camera nor origin is stated.
    pub without_sight: usize,
    /// Time of the first [s].
    pub from: f64,
    /// Time of the last [s].
    pub to: f64,
    /// Points of all of them.
    pub points: usize,
    /// Fewest and most of a cloud.
    pub points_per_cloud: [usize; 2],
    /// Standard deviation of a distance in the first [m]; `None` where it is not stated.
    pub noise: Option<f64>,
}

/// Depth images.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Images {
    /// How many.
    pub count: usize,
    /// Time of the first [s].
    pub from: f64,
    /// Time of the last [s].
    pub to: f64,
    /// Pixels with a reading of the object, in all images.
    pub readings: usize,
    /// Fewest and most of an image.
    pub readings_per_image: [usize; 2],
}

/// Markers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Markers {
    /// Their names.
    pub names: Vec<String>,
    /// Readings of all.
    pub readings: usize,
    /// Time of the first reading [s].
    pub from: Option<f64>,
    /// Time of the last reading [s].
    pub to: Option<f64>,
    /// Standard deviation of a coordinate [m]; `None` where it is not stated.
    pub noise: Option<f64>,
    /// How many have a rest place.
    pub rest_places: usize,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    fn document(content: Inspected) -> InspectionDocument {
        InspectionDocument { path: "a.toml".into(), warnings: vec!["something".into()], content }
    }

    #[test]
    fn a_scene_is_what_it_was_when_it_is_read_again() {
        let plain = SceneInspection { size: [0.1, 0.2, 1.0 / 3.0], volume: 1.28e-4, ..SceneInspection::default() };
        let file = round_trip(&document(Inspected::Scene(Box::new(plain.clone()))));
        assert_eq!((&file["kind"], keys(&file).len()), (&"scene".into(), 17));
        let whole = SceneInspection {
            title: Some("Beam".into()),
            open_edges: Some(0),
            device_memory: Some(1 << 40),
            device_batch: Some(2),
            device_refusal: Some("too small".into()),
            observation: Some(Observed { points_per_frame: [1, 9], overlap: true, ..Observed::default() }),
            free: Some(vec!["material.density".into()]),
            ..plain
        };
        assert_eq!(keys(&round_trip(&document(Inspected::Scene(Box::new(whole))))).len(), 24);
    }

    #[test]
    fn a_recording_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&document(Inspected::Recording(Box::default())));
        assert_eq!(keys(&file), ["format", "kind", "path", "warnings"]);
        let camera = CameraInspection {
            name: "left".into(),
            width: 24,
            height: 18,
            noise: Some(5e-4),
            systematic: 0.0,
            position: [0.25, -0.3, 0.15],
        };
        let whole = RecordingInspection {
            title: Some("Seen".into()),
            cameras: vec![camera],
            frames: Some(Images { count: 17, from: 0.0, to: 0.16, readings: 4000, readings_per_image: [200, 260] }),
            clouds: Some(Clouds {
                count: 2,
                without_sight: 1,
                from: 0.0,
                to: 0.1,
                points: 30,
                points_per_cloud: [10, 20],
                noise: None,
            }),
            markers: Some(Markers {
                names: vec!["tip".into()],
                readings: 0,
                from: None,
                to: None,
                noise: Some(1e-3),
                rest_places: 1,
            }),
            points: Some(SequenceInspection { count: 5, frames: 3, readings: 14, unseen: 1, from: 0.0, to: 0.2, noise: None }),
            displacements: None,
        };
        let file = round_trip(&document(Inspected::Recording(Box::new(whole))));
        assert_eq!((&file["kind"], &file["frames"]["count"]), (&"recording".into(), &17.into()));
        assert!(file["markers"]["from"].is_null());
    }
}
