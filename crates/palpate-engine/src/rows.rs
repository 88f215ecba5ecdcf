//! Every scalar residual of a simulation by itself, with its sensitivities: what statistics on a fit need beyond sums.

use crate::evaluate::Evaluation;
use glam::DVec3;
use palpate_model::observation::{ReadingKind, Sensor};

/// Where a scalar residual comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Source {
    /// What took the reading.
    pub sensor: Sensor,
    /// Which of its readings: number of the depth point in its frame, of the marker's or tracked point's site, of the node.
    pub item: u32,
    /// Coordinate, 0 to 2; 0 of a distance.
    pub axis: u8,
}

impl Source {
    /// A point of the surface: its number in the frame, and what saw it.
    pub fn point(point: u32, sensor: Sensor) -> Source {
        Source { sensor, item: point, axis: 0 }
    }

    /// True of a point of the surface.
    pub fn is_depth(&self) -> bool {
        self.sensor.kind() == ReadingKind::Depth
    }

    /// What part of a reading the residual is: 1 of a distance, a third of a position or displacement.
    pub fn share(&self) -> f64 {
        1.0 / self.sensor.kind().components() as f64
    }

    /// The sensor's output that the residual belongs to.
    pub fn stream(&self) -> Stream {
        Stream { sensor: self.sensor, axis: self.axis }
    }
}

/// Distances of a sensor, or one coordinate of what it sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Stream {
    /// The sensor.
    pub sensor: Sensor,
    /// Coordinate, 0 to 2; 0 of a distance.
    pub axis: u8,
}

/// One scalar residual r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualRow {
    /// Number of the frame in the plan's observation.
    pub frame: usize,
    /// What was measured.
    pub source: Source,
    /// Signed distance or coordinate, simulated minus measured for the latter [m]; `None` for a point that met nothing.
    pub value: Option<f64>,
    /// Stated standard deviation of the measurement [m], which divides the residual in the cost.
    pub noise: f64,
    /// Robust weight ρ′(r)/r, 0 to 1; 0 for a point that met nothing.
    pub weight: f64,
    /// Place of the measurement on the rest shape [m]; the measured place itself where it met nothing.
    pub rest: DVec3,
    /// Change of the residual per metre that the point moves away from its camera along the line of sight (1 for coordinates): noise
    /// along the line of sight reaches the residual multiplied by it. Of a point without a line of sight, per metre in its worst direction.
    pub along_sight: f64,
    /// ∂r by the measured place in the world; zero for a point that met nothing.
    pub by_place: DVec3,
}

impl ResidualRow {
    /// A coordinate of something whose place on the rest shape is known, simulated minus measured: all of it counts.
    pub fn coordinate(frame: usize, source: Source, value: f64, noise: f64, rest: DVec3) -> ResidualRow {
        let by_place = -DVec3::AXES[usize::from(source.axis)];
        ResidualRow { frame, source, value: Some(value), noise, weight: 1.0, rest, along_sight: 1.0, by_place }
    }
}

/// Residuals of one or several frames with their sensitivities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// The residuals `[R]`, frame by frame: points in the frame's order, then markers, then nodes.
    pub residuals: Vec<ResidualRow>,
    /// ∂r/∂θ of every residual along the tangent directions `[R, Q]`; zero where a point met nothing.
    pub sensitivity: Vec<f64>,
}

/// A simulation's residuals and their first derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearised {
    /// Cost and sums.
    pub evaluation: Evaluation,
    /// Places in θ that the columns belong to `[Q]`.
    pub directions: Vec<usize>,
    /// All rows, ordered by frame.
    pub rows: Rows,
}
