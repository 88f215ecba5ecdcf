//! The lattice around a body of tetrahedra in which observed points are looked up: its corners follow the body's nodes, so that cells deform with it
//! as the cells of a body that is cut out of a lattice do.
//!
//! A corner within the body has the element's own field; one outside has the value there of the affine field that fits the nodes around the nearest
//! place of the surface best ([`super::extension`]).

use crate::cutcells::build::{BodyError, lattice_for};
use crate::cutcells::domain::Band;
use crate::cutcells::extension::{AffineFit, Nearby, band_of};
use crate::shape::Shape;
use crate::space::body::Body;
use glam::DVec3;
use std::collections::HashMap;

/// First radius of the fit's kernel, in distances of neighbouring nodes: as on cells.
const RADIUS: f64 = 2.5;

/// Nodes in cubes of their mean distance.
pub(crate) struct InCubes<'a> {
    body: &'a Body,
    edge: f64,
    cubes: HashMap<[i64; 3], Vec<u32>>,
}

impl InCubes<'_> {
    /// Sorts the nodes.
    pub(crate) fn new(body: &Body) -> InCubes<'_> {
        let edge = (body.volume / body.nodes.len() as f64).cbrt();
        let mut all = InCubes { body, edge, cubes: HashMap::new() };
        for (n, x) in (0u32..).zip(&body.nodes) {
            all.cubes.entry(all.cube(*x)).or_default().push(n);
        }
        all
    }

    fn cube(&self, x: DVec3) -> [i64; 3] {
        (x / self.edge).to_array().map(|x| x.floor() as i64)
    }
}

impl Nearby for InCubes<'_> {
    fn spacing(&self) -> f64 {
        self.edge
    }

    fn reach(&self) -> f64 {
        2.0 * self.body.size()
    }

    fn visit(&self, center: DVec3, radius: f64, visit: &mut dyn FnMut(u32, f64)) {
        let body = self.body;
        let mut hand = |n: u32| visit(n, body.node_volume[n as usize] / self.edge.powi(3));
        let [lo, hi] = [center - radius, center + radius].map(|x| self.cube(x));
        let asked: i64 = (0..3).map(|a| hi[a] - lo[a] + 1).product();
        if asked > body.nodes.len() as i64 {
            return (0..body.nodes.len() as u32).for_each(hand);
        }
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                for i in lo[0]..=hi[0] {
                    self.cubes.get(&[i, j, k]).into_iter().flatten().for_each(|n| hand(*n));
                }
            }
        }
    }
}

/// The band of width `width` [m] around a body of tetrahedra, on a lattice of edge `h` [m].
///
/// # Errors
/// The lattice would be too large.
pub fn shadow(body: &Body, shape: &dyn Shape, h: f64, width: f64) -> Result<Band, BodyError> {
    let (grid, _) = lattice_for(shape, h, width)?;
    let (carrier, near) = (body.carrier(), InCubes::new(body));
    let row = |p: DVec3| {
        let (inside, away) = carrier.carry(p);
        if away == 0.0 {
            return (inside.nodes, inside.value);
        }
        let fit = AffineFit::new(body, &near, shape.closest_point(p), RADIUS * near.edge);
        let weights = fit.value(p);
        (fit.nodes, weights)
    };
    let (active, number) = (vec![false; grid.len()], vec![u32::MAX; grid.len()]);
    Ok(band_of(body, shape, width, grid, &active, number, row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::MeshShape;
    use crate::space::points::tests::block;
    use crate::space::tets::Tetrahedron;
    use glam::DMat3;

    #[test]
    fn corners_have_the_body_s_field_inside_and_continue_affine_motion_outside() {
        let mesh = block().checked().unwrap();
        let shape = MeshShape::new(mesh.surface());
        for kind in [Tetrahedron::Linear, Tetrahedron::Quadratic] {
            let body = Body::of_tets(&mesh, kind);
            let band = shadow(&body, &shape, 0.03, 0.05).unwrap();
            let value = |field: &[DVec3], p: usize| {
                let row = band.rows[p] as usize..band.rows[p + 1] as usize;
                band.columns[row.clone()].iter().zip(&band.values[row]).map(|(n, w)| *w * field[*n as usize]).sum::<DVec3>()
            };
            let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
            let affine: Vec<DVec3> = body.nodes.iter().map(|x| f * *x + DVec3::Y).collect();
            let bowl = |x: DVec3| DVec3::new(x.x * x.y, x.z * x.z, x.x * x.x - x.y * x.z);
            let bent: Vec<DVec3> = body.nodes.iter().map(|x| bowl(*x)).collect();
            let mut inside = 0;
            for (p, x) in band.nodes.iter().enumerate() {
                assert!((value(&affine, p) - (f * *x + DVec3::Y)).length() < 1e-11, "at {x}");
                if kind == Tetrahedron::Quadratic && shape.signed_distance(*x) < 0.0 {
                    inside += 1;
                    assert!((value(&bent, p) - bowl(*x)).length() < 1e-14, "at {x}");
                }
            }
            assert!(kind == Tetrahedron::Linear || inside > 20, "{inside}");
            // Every place within the width is in some cell, and knows its distance.
            let lookup = crate::cutcells::band_lookup::BandLookup::of(&band);
            for x in [DVec3::new(0.1, 0.05, 0.05), DVec3::new(0.249, 0.05, 0.05), DVec3::new(-0.02, -0.02, 0.11)] {
                let (distance, _) = lookup.distance(&band, x).unwrap();
                assert!((distance - shape.signed_distance(x)).abs() < 0.01, "at {x}: {distance}");
            }
        }
    }
}
