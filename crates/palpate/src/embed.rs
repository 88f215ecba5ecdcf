//! A fine surface carried by the coarse grid: points of the rest configuration as weights of simulation nodes.

use glam::DVec3;
use palpate_model::space::body::Body;
use palpate_model::space::stencil::Stencils;
use rayon::prelude::*;

/// Points of the rest configuration that follow the simulation's nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedding {
    /// Rest positions [m], shape `[V]`.
    pub rest: Vec<DVec3>,
    /// Where each point is, shape `[V]`.
    pub places: Stencils,
    /// Largest distance of a point from the element that carries it [m]; zero when all lie inside.
    pub farthest: f64,
}

impl Embedding {
    /// Finds the element of every point. A point outside all of them follows the nearest one, whose field is continued to it (exact for
    /// affine motion).
    pub fn new(body: &Body, rest: Vec<DVec3>) -> Embedding {
        let carrier = body.carrier();
        let mut places = Stencils::default();
        let mut farthest: f64 = 0.0;
        for (place, outside) in rest.par_iter().map(|p| carrier.carry(*p)).collect::<Vec<_>>() {
            farthest = farthest.max(outside);
            places.push(&place.nodes, &place.value);
        }
        Embedding { rest, places, farthest }
    }

    /// Deformed positions [m] of the points at node displacements `[N]` [m].
    pub fn deform(&self, displacement: &[DVec3]) -> Vec<DVec3> {
        self.rest.iter().zip(self.carry(displacement)).map(|(x, u)| x + u).collect()
    }

    /// Values of a node field `[N]` at the points.
    pub fn carry<'a>(&'a self, field: &'a [DVec3]) -> impl Iterator<Item = DVec3> + 'a {
        self.places.iter().map(|s| s.at(field))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use palpate_model::cutcells::domain::{Cell, CutCells};
    use palpate_model::cutcells::grid::{CORNERS, Grid};

    /// Two cells in a row, side 0.1.
    fn body() -> Body {
        let grid = Grid { offset: [-2, -2, -2], size: [8, 6, 6], h: 0.1 };
        let mut nodes = Vec::new();
        let mut number = std::collections::BTreeMap::new();
        let mut cells = Vec::new();
        for i in 0..2 {
            let lattice = [2 + i, 2, 2];
            let nodes = CORNERS.map(|c| {
                let ijk = [0, 1, 2].map(|a| lattice[a] + c[a] as usize);
                *number.entry(ijk).or_insert_with(|| {
                    nodes.push(grid.position(ijk));
                    nodes.len() as u32 - 1
                })
            });
            cells.push(Cell { lattice, nodes, fraction: 1.0, weights: [1.0 / 27.0; 27] });
        }
        Body {
            node_volume: vec![0.0; nodes.len()],
            length: grid.h,
            nodes,
            cut: Some(CutCells { grid, cells, ghosts: vec![] }),
            band: Default::default(),
            patches: vec![],
            surface: Default::default(),
            points: Default::default(),
            volume: 0.002,
            area: 0.1,
            center: DVec3::new(0.1, 0.05, 0.05),
            corners: (DVec3::ZERO, DVec3::ZERO),
        }
    }

    #[test]
    fn affine_motion_is_carried_exactly_inside_and_outside_the_cells() {
        let body = body();
        let points = vec![
            DVec3::new(0.03, 0.05, 0.09),
            DVec3::new(0.17, 0.0, 0.1),
            DVec3::new(0.21, 0.12, -0.01),
            DVec3::new(0.9, 0.0, 0.0),
        ];
        let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
        let e = Embedding::new(&body, points.clone());
        let u: Vec<DVec3> = body.nodes.iter().map(|x| f * *x - *x + DVec3::X).collect();
        for (p, x) in points.iter().zip(e.deform(&u)) {
            // Rounding only; the last point lies seven cells away, which amplifies it.
            assert!((f * *p + DVec3::X - x).length() < 1e-12);
        }
        assert!((e.farthest - 0.7).abs() < 1e-12, "{}", e.farthest);
    }

    #[test]
    fn a_point_outside_takes_the_nearest_cell() {
        let e = Embedding::new(&body(), vec![DVec3::new(0.12, 0.13, 0.05), DVec3::new(0.08, 0.13, 0.05)]);
        let body = body();
        let cells = body.cells();
        assert_eq!([0, 1].map(|k| e.places.get(k).nodes.to_vec()), [1, 0].map(|k| cells[k].nodes.to_vec()));
        assert!((e.farthest - 0.03).abs() < 1e-12);
    }
}
