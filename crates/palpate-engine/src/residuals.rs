//! Residuals of frames reading by reading, for reports.

use glam::DVec3;
use palpate_model::observation::Sensor;

/// Residuals of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameResiduals {
    /// Number of the frame in the plan's observation.
    pub frame: usize,
    /// Its readings: depth points in the frame's order, then markers and tracked points, then nodes.
    pub readings: Vec<ReadingResidual>,
}

/// How far one reading lies from the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingResidual {
    /// What took it.
    pub sensor: Sensor,
    /// Number of the depth point in its frame, of the marker's or tracked point's site, of the node.
    pub item: u32,
    /// Where it was measured [m].
    pub place: DVec3,
    /// The residual; `None` where it met nothing.
    pub misfit: Option<Misfit>,
}

/// A residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misfit {
    /// Signed distance from the surface [m], positive outside the simulated body.
    Distance(f64),
    /// Simulated minus measured position or displacement [m].
    Offset(DVec3),
}

impl Misfit {
    /// Square of its length [m²].
    pub fn length_squared(self) -> f64 {
        match self {
            Misfit::Distance(d) => d * d,
            Misfit::Offset(v) => v.length_squared(),
        }
    }

    /// Its scalar residuals, with the coordinate that each belongs to.
    pub fn components(self) -> impl Iterator<Item = (u8, f64)> {
        let (values, count) = match self {
            Misfit::Distance(d) => ([d, 0.0, 0.0], 1),
            Misfit::Offset(v) => (v.to_array(), 3),
        };
        (0..).zip(values).take(count)
    }
}

impl FrameResiduals {
    /// Depth points in the frame's order: signed distance [m], `None` where a point met nothing.
    pub fn distances(&self) -> impl Iterator<Item = Option<f64>> {
        self.readings.iter().filter(|r| r.sensor.is_depth()).map(|r| match r.misfit {
            Some(Misfit::Distance(d)) => Some(d),
            _ => None,
        })
    }

    /// Everything but depth points, with its vector [m].
    pub fn offsets(&self) -> impl Iterator<Item = (&ReadingResidual, DVec3)> {
        self.readings.iter().filter_map(|r| match r.misfit {
            Some(Misfit::Offset(v)) => Some((r, v)),
            _ => None,
        })
    }
}
