//! Distances from the surface anywhere in the band of the rest shape.

use crate::cutcells::distances::interpolate;
use crate::space::body::Body;
use glam::DVec3;

/// Numbers of the band cells by lattice cell (linear number of the lowest node); empty for a body without cells.
#[derive(Clone, Debug)]
pub struct BandLookup(Vec<u32>);

impl BandLookup {
    /// Looks every band cell up once.
    pub fn new(body: &Body) -> BandLookup {
        let Some(cut) = &body.cut else { return BandLookup(Vec::new()) };
        let mut cells = vec![u32::MAX; cut.grid.len()];
        for (c, cell) in cut.band.cells.iter().enumerate() {
            cells[cut.grid.index(cell.lattice)] = c as u32;
        }
        BandLookup(cells)
    }

    /// Distance of a place of the rest configuration from the surface [m] with its derivative by ξ, in the band.
    pub fn distance(&self, body: &Body, place: DVec3) -> Option<(f64, DVec3)> {
        let cut = body.cut.as_ref()?;
        let (ijk, xi) = cut.grid.locate(place)?;
        let cell = self.0[cut.grid.index(ijk)];
        (cell != u32::MAX).then(|| interpolate(&cut.band.cells[cell as usize].sdf, xi))
    }
}
