//! Points of the body that a file says something about at every time: forces that act on them, or places that they are drawn to.

use crate::mechanics::series::Series;
use crate::space::stencil::Stencils;
use glam::DVec3;
use std::sync::Arc;

/// Where the points of a series are on the body.
#[derive(Clone, Debug, PartialEq)]
pub enum Points {
    /// Simulation nodes by their number `[n]`.
    Nodes(Vec<u32>),
    /// Places at rest [m] `[n]`, and how far from the body they may lie [m]; `None` = two cells.
    Places(Vec<DVec3>, Option<f64>),
}

impl Points {
    /// Number of points n.
    pub fn len(&self) -> usize {
        match self {
            Points::Nodes(nodes) => nodes.len(),
            Points::Places(places, _) => places.len(),
        }
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// What drives an effect: a vector for each of its points at every time.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Where the points are.
    pub points: Points,
    /// Forces [N] or places [m].
    pub series: Arc<Series>,
    /// Numbers of the recording's tracked points that these are, where they are some of them: what holds the body is not compared with it.
    pub tracked: Vec<u32>,
}

impl Drive {
    /// Of the first node, a vector of zero at all times: of an effect that is to be driven by something else.
    pub fn still() -> Drive {
        Drive { points: Points::Nodes(vec![0]), series: Arc::new(Series::constant(vec![DVec3::ZERO])), tracked: Vec::new() }
    }
}

/// A [`Drive`] on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenSites {
    /// What every point follows of the nodes.
    pub stencils: Stencils,
    /// Its place at rest [m].
    pub rest: Vec<DVec3>,
    /// Forces [N] or places [m].
    pub series: Arc<Series>,
}
