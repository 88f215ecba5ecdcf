//! Channels: what kinds of readings a recording holds, and how exact they are; sensors: what took a reading.

use std::fmt;

/// How a reading is compared with a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ReadingKind {
    /// A point of a depth image or a point cloud, and its distance from the surface: one residual.
    Depth,
    /// Displacement of a simulation node: three residuals.
    Displacement,
    /// Position of a marker that the body carries, also on a stalk: three residuals.
    #[default]
    Marker,
    /// Position of a point of the body itself: three residuals.
    Track,
}

impl ReadingKind {
    /// Every kind.
    pub const ALL: [ReadingKind; 4] = [ReadingKind::Depth, ReadingKind::Displacement, ReadingKind::Marker, ReadingKind::Track];

    /// Word for messages and result files.
    pub fn name(self) -> &'static str {
        match self {
            ReadingKind::Depth => "depth",
            ReadingKind::Displacement => "displacements",
            ReadingKind::Marker => "markers",
            ReadingKind::Track => "points",
        }
    }

    /// Scalar residuals of one reading.
    pub fn components(self) -> usize {
        if self == ReadingKind::Depth { 1 } else { 3 }
    }
}

/// Readings of one kind, with what the recording says of their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// How they are compared.
    pub kind: ReadingKind,
    /// Standard deviation of one scalar residual [m]; divides it.
    pub noise: f64,
    /// Size of errors that do not average out over readings [m]; widens standard errors.
    pub systematic: f64,
}

impl Channel {
    /// A channel of a given noise [m], without systematic errors.
    pub fn new(kind: ReadingKind, noise: f64) -> Channel {
        Channel { kind, noise, systematic: 0.0 }
    }
}

/// What took a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sensor {
    /// A depth camera, by its number in [`super::Observation::cameras`].
    Camera(u32),
    /// What a point cloud without a camera was seen from, by its number in [`super::Observation::cameras`].
    Cloud(u32),
    /// Whatever gave displacements of simulation nodes.
    Nodes,
    /// A marker, by its number in [`super::Observation::markers`].
    Marker(u32),
    /// Whatever tracked points of the body, all of them together.
    Tracks,
}

impl Sensor {
    /// How its readings are compared.
    pub fn kind(self) -> ReadingKind {
        match self {
            Sensor::Camera(_) | Sensor::Cloud(_) => ReadingKind::Depth,
            Sensor::Nodes => ReadingKind::Displacement,
            Sensor::Marker(_) => ReadingKind::Marker,
            Sensor::Tracks => ReadingKind::Track,
        }
    }

    /// True of a sensor with many readings at one time, spread over the body; false of one with a single reading.
    pub fn is_spread(self) -> bool {
        !matches!(self, Sensor::Marker(_))
    }

    /// True of a depth camera: its readings stand in the order of an image's pixels.
    pub fn is_camera(self) -> bool {
        matches!(self, Sensor::Camera(_))
    }

    /// True of what gives points of the surface.
    pub fn is_depth(self) -> bool {
        self.kind() == ReadingKind::Depth
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Sensor::Camera(c) => write!(f, "camera {c}"),
            Sensor::Cloud(c) => write!(f, "cloud {c}"),
            Sensor::Nodes => write!(f, "nodes"),
            Sensor::Marker(m) => write!(f, "marker {m}"),
            Sensor::Tracks => write!(f, "points"),
        }
    }
}
