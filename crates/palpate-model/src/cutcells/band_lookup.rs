//! Distances from the surface anywhere in the band of the rest shape.

use crate::cutcells::distances::interpolate;
use crate::cutcells::domain::Band;
use glam::DVec3;

/// Numbers of the band cells by lattice cell (linear number of the lowest node); empty for a body without a band.
#[derive(Clone, Debug)]
pub struct BandLookup(Vec<u32>);

impl BandLookup {
    /// Looks every band cell up once.
    pub fn of(band: &Band) -> BandLookup {
        let mut cells = vec![u32::MAX; band.grid.len()];
        for (c, cell) in band.cells.iter().enumerate() {
            cells[band.grid.index(cell.lattice)] = c as u32;
        }
        BandLookup(cells)
    }

    /// Distance of a place of the rest configuration from the surface [m] with its derivative by ξ, in the band.
    pub fn distance(&self, band: &Band, place: DVec3) -> Option<(f64, DVec3)> {
        if self.0.is_empty() {
            return None;
        }
        let (ijk, xi) = band.grid.locate(place)?;
        let cell = self.0[band.grid.index(ijk)];
        (cell != u32::MAX).then(|| interpolate(&band.cells[cell as usize].sdf, xi))
    }
}
