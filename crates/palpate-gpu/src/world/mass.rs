//! The mass matrix of a body of tetrahedra or of stars, which bear their own mass alone, entry by entry of the pattern of blocks; densities may vary
//! over the body from member to member.

use crate::device::Arena;
use palpate_model::plan::Plan;
use palpate_model::space::pattern::Places;
use palpate_model::space::tets::{lumped_mean, mass};

/// Where elements add to the matrix.
#[derive(Debug)]
pub(crate) struct MassTable {
    /// Nodes that bear an element's mass; zero for a body of cells.
    nodes: usize,
    /// Entries of an element's matrix over its mass, row by row.
    shares: Vec<f64>,
    /// Blocks of the nodes of every element, element by element, row by row.
    places: Vec<u32>,
    blocks: usize,
}

impl MassTable {
    pub(super) fn new(plan: &Plan, places: &Places, blocks: usize) -> MassTable {
        let points = &plan.body.points;
        let nodes = if points.is_empty() { 0 } else { points.bearers(0).nodes.len() };
        let shares = (0..nodes * nodes).map(|k| mass(nodes, k / nodes, k % nodes)).collect();
        // A star's first block is its own point's.
        let own = |e| places.points.of(points.mean_point(e)).iter().copied().take(nodes * nodes);
        let places = (0..points.elements()).flat_map(own).collect();
        MassTable { nodes, shares, places, blocks }
    }

    /// Entries that a member's mass matrix has on the device.
    pub(crate) fn entries(&self) -> usize {
        if self.nodes == 0 { 0 } else { self.blocks }
    }

    /// The matrix over the density, for factors on the densities of nodes or none: of derivatives, its change.
    pub(super) fn matrix(&self, plan: &Plan, factors: Option<&[f64]>) -> Vec<f64> {
        let (points, mut out) = (&plan.body.points, vec![0.0; self.entries()]);
        for (e, places) in self.places.chunks_exact(self.shares.len().max(1)).enumerate() {
            let volume = points.element_volume(e) * factors.map_or(1.0, |f| lumped_mean(&points.bearers(e), f));
            places.iter().zip(&self.shares).for_each(|(place, share)| out[*place as usize] += volume * share);
        }
        out
    }

    /// Adds what all members share to an arena.
    pub(super) fn put(&self, tables: &mut Arena) {
        let shares: Vec<f32> = self.shares.iter().map(|s| *s as f32).collect();
        tables.put("mass_shares", &shares);
    }
}
