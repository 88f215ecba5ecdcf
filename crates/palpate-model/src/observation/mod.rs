//! What was measured, ready to be compared: channels, frames, and where sensors and tracked things sit.

pub mod channel;
pub mod frame;
pub mod instant;
pub mod kernel;
pub mod marker;
pub mod target;
pub mod view;

pub use channel::{Channel, ReadingKind, Sensor};
pub use frame::{Camera, Frame, ObservedDisplacement, ObservedMarker, ObservedPoint};
pub use marker::{MarkerRest, MarkerSite, TrackRest};
pub use view::{Recording, View, Viewed};

use glam::DVec3;

/// Everything observed in one recording, in world coordinates and SI units.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// Kinds of readings that frames may hold, one channel each at most.
    pub channels: Vec<Channel>,
    /// Cameras, for visibility, and after them what else saw points of the surface.
    pub cameras: Vec<Camera>,
    /// Their names in the recording; fewer where it gives none.
    pub camera_names: Vec<String>,
    /// Frames ordered by time; times are on the recording's clock.
    pub frames: Vec<Frame>,
    /// Where markers sit on the body, and after them, where tracked points do.
    pub markers: Vec<MarkerSite>,
    /// Rest places of tracked points: their sites are made of them when a plan is built.
    pub tracks: TrackRest,
    /// Nodes that displacements count, for a plan to compare with its own.
    pub nodes: Option<NodeRest>,
}

/// Simulation nodes as a recording of displacements knows them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeRest {
    /// Number of nodes N.
    pub count: usize,
    /// Their rest places [m] `[N]`; empty where the recording does not say.
    pub places: Vec<DVec3>,
}

impl Observation {
    /// Number of scalar residuals over all frames (a depth point counts 1, everything else 3).
    pub fn residuals(&self) -> usize {
        self.frames.iter().map(Frame::residuals).sum()
    }

    /// The channel of a kind, if the recording has it.
    pub fn channel(&self, kind: ReadingKind) -> Option<&Channel> {
        self.channels.iter().find(|c| c.kind == kind)
    }

    /// Standard deviation of one scalar residual of a kind [m]; infinite without such a channel, so that readings weigh nothing.
    pub fn noise(&self, kind: ReadingKind) -> f64 {
        self.channel(kind).map_or(f64::INFINITY, |c| c.noise)
    }

    /// The same for markers and tracked points of a frame, which may have its own.
    pub fn noise_in(&self, frame: &Frame, kind: ReadingKind) -> f64 {
        let of_points = matches!(kind, ReadingKind::Marker | ReadingKind::Track);
        frame.noise.filter(|_| of_points).unwrap_or_else(|| self.noise(kind))
    }

    /// Size of errors of a kind that do not average out [m]; 0 without such a channel.
    pub fn systematic(&self, kind: ReadingKind) -> f64 {
        self.channel(kind).map_or(0.0, |c| c.systematic)
    }

    /// Name of a sensor: that of the camera or marker in the recording, or what it is.
    pub fn name(&self, sensor: Sensor) -> String {
        let known = match sensor {
            Sensor::Camera(c) | Sensor::Cloud(c) => self.camera_names.get(c as usize).cloned(),
            Sensor::Marker(m) => self.markers.get(m as usize).map(|m| m.name.clone()),
            Sensor::Nodes | Sensor::Tracks => None,
        };
        known.unwrap_or_else(|| sensor.to_string())
    }

    /// The sensor that takes readings of a site.
    pub fn sensor_of(&self, site: u32) -> Sensor {
        match self.markers[site as usize].kind {
            ReadingKind::Track => Sensor::Tracks,
            _ => Sensor::Marker(site),
        }
    }

    /// The sensor that saw a point of the surface.
    pub fn sensor_of_point(&self, point: &ObservedPoint) -> Sensor {
        self.cameras[point.camera as usize].sensor(point.camera)
    }

    /// Number of depth cameras, what else saw points not among them.
    pub fn camera_count(&self) -> usize {
        self.cameras.iter().filter(|c| matches!(c, Camera::Pinhole { .. })).count()
    }

    /// True where some point of the surface has a line of sight, or there is no such point.
    pub fn has_sight(&self) -> bool {
        let mut used = self.frames.iter().flat_map(|f| &f.points).map(|p| &self.cameras[p.camera as usize]).peekable();
        used.peek().is_none() || used.any(|c| c.center().is_some())
    }

    /// Number of markers, tracked points not among them.
    pub fn marker_count(&self) -> usize {
        self.markers.iter().filter(|m| m.kind == ReadingKind::Marker).count()
    }

    /// Number of sensors of a kind that took readings, each with errors of its own.
    pub fn sensors(&self, kind: ReadingKind) -> usize {
        let used = |c: usize| self.frames.iter().flat_map(|f| &f.points).any(|p| p.camera as usize == c);
        match kind {
            ReadingKind::Depth => (0..self.cameras.len()).filter(|c| used(*c)).count(),
            ReadingKind::Marker => self.marker_count(),
            ReadingKind::Track | ReadingKind::Displacement => 1,
        }
    }

    /// Number of readings of a kind over all frames.
    pub fn readings(&self, kind: ReadingKind) -> usize {
        self.frames.iter().map(|f| self.readings_in(f, kind)).sum()
    }

    /// Number of readings of a kind in a frame of this observation.
    pub fn readings_in(&self, frame: &Frame, kind: ReadingKind) -> usize {
        match kind {
            ReadingKind::Depth => frame.points.len(),
            ReadingKind::Displacement => frame.displacements.len(),
            _ => frame.markers.iter().filter(|m| self.markers[m.site as usize].kind == kind).count(),
        }
    }

    /// Channels, cameras and markers alone: enough to simulate what sensors would read.
    pub fn without_frames(&self) -> Observation {
        Observation {
            channels: self.channels.clone(),
            cameras: self.cameras.clone(),
            camera_names: self.camera_names.clone(),
            markers: self.markers.clone(),
            ..Observation::default()
        }
    }
}
