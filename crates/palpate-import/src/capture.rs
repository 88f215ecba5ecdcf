//! What every format is read into: images, clouds, markers or tracks with their times, and what is known about them.

use crate::budget::Budget;
use crate::error::ImportError;
use crate::lens::Optics;
use crate::options::Unit;
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// Everything that a source holds, in its own units and axes.
#[derive(Clone, Debug, Default)]
pub struct Capture {
    /// What it is called.
    pub title: String,
    /// Depth cameras.
    pub cameras: Vec<DepthCamera>,
    /// Point clouds.
    pub clouds: Vec<Cloud>,
    /// Where the clouds were seen from, in their axes and unit; `None` = the source does not say.
    pub viewpoint: Option<DVec3>,
    /// Markers.
    pub markers: Option<Markers>,
    /// Points that are followed without markers.
    pub tracks: Option<Tracks>,
    /// Where the frames of the tracks are equilibria one after another, and no motion: what is known of them.
    pub equilibria: Option<Equilibria>,
    /// Files that come to lie beside the recording: name and text.
    pub beside: Vec<(String, String)>,
    /// Unit of clouds, markers and tracks, where the source says it, and what it says.
    pub unit: Option<(Unit, String)>,
    /// Unit where it does not.
    pub usual_unit: Option<(Unit, &'static str)>,
    /// Upward direction in the source's axes, and who says so; a convention of the format is a guess.
    pub up: Option<(DVec3, String)>,
    /// What was assumed in reading.
    pub guesses: Vec<Guess>,
    /// What is known, worth a word.
    pub facts: Vec<String>,
    /// What the source holds and the recording will not.
    pub losses: Vec<String>,
}

/// One depth camera and its images.
#[derive(Clone, Debug)]
pub struct DepthCamera {
    /// Label.
    pub name: String,
    /// Pixels per row and column.
    pub size: [usize; 2],
    /// From rays to pixels.
    pub optics: Optics,
    /// Metres of a count, where the source says it.
    pub scale: Option<f64>,
    /// Metres of a count that is usual in this format.
    pub usual_scale: (f64, &'static str),
    /// Camera to world, where the source says it: one for all images, or one each.
    pub poses: Vec<DAffine3>,
    /// Images, ordered by time.
    pub frames: Vec<DepthFrame>,
    /// True for a camera that was made up here: there is no word about its units and pose.
    pub made: bool,
}

/// One depth image.
#[derive(Clone, Debug)]
pub struct DepthFrame {
    /// On the source's clock [s].
    pub time: f64,
    /// Where it was read from, for what is wrong with it.
    pub file: PathBuf,
    /// Row by row.
    pub pixels: Pixels,
    /// True where the object is.
    pub mask: Option<Vec<bool>>,
}

/// Depth along the camera's axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// Counts; 0 = no reading.
    Counts(Vec<u16>),
    /// Lengths; what is not finite or not positive is no reading.
    Lengths(Vec<f32>),
}

impl Pixels {
    /// Counts their memory.
    ///
    /// # Errors
    /// All that was read so far takes more than there is.
    pub fn take(&self, source: &Path, budget: &mut Budget) -> Result<(), ImportError> {
        match self {
            Pixels::Counts(c) => budget.take(source, c),
            Pixels::Lengths(l) => budget.take(source, l),
        }
    }

    /// Number of pixels.
    pub fn count(&self) -> usize {
        match self {
            Pixels::Counts(c) => c.len(),
            Pixels::Lengths(l) => l.len(),
        }
    }
}

/// A point cloud.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// On the source's clock [s].
    pub time: f64,
    /// Where it was read from.
    pub file: PathBuf,
    /// Finite points, in the source's unit.
    pub points: Vec<DVec3>,
}

/// Labelled markers.
#[derive(Clone, Debug, Default)]
pub struct Markers {
    /// Labels.
    pub names: Vec<String>,
    /// On the source's clock [s], rising.
    pub times: Vec<f64>,
    /// Places `[times, names]`; `None` = not seen.
    pub places: Vec<Option<DVec3>>,
}

/// Points that are followed.
#[derive(Clone, Debug, Default)]
pub struct Tracks {
    /// On the source's clock [s], rising.
    pub times: Vec<f64>,
    /// Points a time.
    pub count: usize,
    /// Places `[times, count]`; NaN = not seen.
    pub places: Vec<DVec3>,
}

/// What is known of a sequence of equilibria.
#[derive(Clone, Debug, Default)]
pub struct Equilibria {
    /// Numbers of the tracks that something outside moves: strings, a stand.
    pub fixed: Vec<usize>,
    /// Numbers of the frames that a fit shall see; none = all.
    pub train: Vec<usize>,
}

/// Which file a guess is marked in, and at which key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Spot {
    /// A dotted key of `recording.toml`.
    Recording(String),
    /// A dotted key of `scene.toml`.
    Scene(String),
}

/// Something that the source does not say and that was assumed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guess {
    /// What it is about: unit, axis, pose, floor, release time, …
    pub what: &'static str,
    /// What was assumed, and why.
    pub text: String,
    /// The flag that replaces it.
    pub fix: String,
    /// Where it is marked.
    pub spot: Spot,
}

impl Guess {
    /// A guess of the recording.
    pub fn recording(what: &'static str, key: impl Into<String>, text: impl Into<String>, fix: impl Into<String>) -> Guess {
        Guess { what, text: text.into(), fix: fix.into(), spot: Spot::Recording(key.into()) }
    }

    /// A guess of the scene.
    pub fn scene(what: &'static str, key: impl Into<String>, text: impl Into<String>, fix: impl Into<String>) -> Guess {
        Guess { what, text: text.into(), fix: fix.into(), spot: Spot::Scene(key.into()) }
    }

    /// In one line.
    pub fn line(&self) -> String {
        format!("{}: {}; fix with {}", self.what, self.text, self.fix)
    }
}
