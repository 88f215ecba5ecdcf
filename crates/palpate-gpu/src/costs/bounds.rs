//! Upper bounds of the loop iterations of one invocation, for what is observed.

use super::shots::Shots;
use super::tables::{BandTables, Rows, SiteTables};
use super::{MOST_LOOPS, PARTS};
use crate::device::GpuError;
use crate::layout::Sight;
use palpate_model::cutcells::pullback::ITERATIONS;

/// Most derivatives of an evaluation: a workgroup of `weigh_rows` goes through as many rows of the Gauss–Newton matrix.
pub(crate) const MOST_DIRECTIONS: u64 = 256;

/// Refuses more derivatives than that.
pub(super) fn check_directions(count: usize) -> Result<(), GpuError> {
    if count as u64 <= MOST_DIRECTIONS {
        return Ok(());
    }
    Err(GpuError::Plan { what: format!("{count} derivatives at once: {MOST_DIRECTIONS} at most") })
}

/// What the loops of the kernels of an observation run over, at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) nodes: u64,
    /// Layers of cubes of a frame along z, and rows of cubes of all layers.
    pub(crate) layers: u64,
    pub(crate) rows_of_cubes: u64,
    /// Points of a frame, and the stripes that they are dealt out to.
    pub(crate) points: u64,
    pub(crate) stripes: u64,
    /// Weights of a band node, and band nodes with a weight at a node.
    pub(crate) extension: u64,
    pub(crate) fold: u64,
    /// Band cells at a node.
    pub(crate) corners: u64,
    /// Residuals and markers of a frame.
    pub(crate) rows: u64,
    pub(crate) markers: u64,
    /// Nodes of a marker's site, and sites at a node.
    pub(crate) site: u64,
    pub(crate) sites: u64,
    /// Numbers that move depth readings.
    pub(crate) readings: u64,
}

impl Seen {
    pub(super) fn new(s: &Sight, shots: &Shots, band: &BandTables, sites: &SiteTables) -> Seen {
        let across = |s: &crate::layout::Shot| (u64::from(s.cubes[1]), u64::from(s.cubes[2]));
        let (y, z) = shots.shots.iter().map(across).fold((0, 0), |m, c| (m.0.max(c.0), m.1.max(c.1)));
        Seen {
            nodes: s.nodes.into(),
            layers: z,
            rows_of_cubes: y * z,
            points: s.points.into(),
            stripes: s.stripes.into(),
            extension: band.extend.longest() as u64,
            fold: band.fold.longest() as u64,
            corners: band.corners.longest() as u64,
            rows: s.rows.into(),
            markers: s.markers.into(),
            site: sites.stencils.longest() as u64,
            sites: sites.of_node.iter().map(Rows::longest).max().unwrap_or(0) as u64,
            readings: s.readings.into(),
        }
    }

    /// Nodes that a lane of `fold_pulls` goes through.
    pub(crate) fn share(&self) -> u64 {
        self.nodes.div_ceil(64 * self.nodes.div_ceil(64).clamp(1, PARTS as u64))
    }

    /// Bounds by kernel, for those that have long loops; `tests/loops.rs` compares them with the shaders.
    pub(crate) fn loops(&self) -> [(&'static str, u64); 9] {
        let (rows, stripes) = (self.rows_of_cubes, self.stripes);
        // A lane visits its share of every row of cubes, rounded up; a visit is one iteration and those of Newton's method.
        let matching = self.layers + rows + (rows + self.points.div_ceil(8 * stripes)) * (1 + ITERATIONS as u64);
        let pulling = self.layers + rows + rows + self.points.div_ceil(stripes);
        [
            ("match_points", matching),
            ("pull_points", pulling),
            ("extend_band", self.extension),
            ("gather_pulls", self.corners * (1 + stripes)),
            // A node meets every marker of the frame at most once per entry of its sites. 8: the sum over the workgroup.
            ("join_pulls", self.fold + self.sites + self.markers),
            ("fold_pulls", self.share() + 8),
            // 700: rotations of Jacobi's method.
            ("carry_markers", self.site + 700),
            // Corners of a cell, and axes of an offset.
            ("differentiate_rows", self.readings + self.site + 8 + 3),
            // The entry of the matrix that a workgroup adds is found row by row. 8: the sum over the workgroup.
            ("weigh_rows", self.rows.div_ceil(64) + MOST_DIRECTIONS + 8),
        ]
    }

    /// Refuses sizes at which an invocation of some kernel could loop longer than every adapter allows.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        match self.loops().into_iter().find(|l| l.1 > MOST_LOOPS) {
            None => Ok(()),
            Some((what, needed)) => {
                let limit = "loop iterations of one invocation";
                Err(GpuError::Limit { limit, available: MOST_LOOPS, needed, what: format!("the kernel `{what}`") })
            }
        }
    }
}
