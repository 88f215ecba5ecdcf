//! Ghost penalty and contact planes: what pushes besides cells, clamps and inertia.

use glam::DVec3;
use palpate_model::body::{Body, Patch};
use palpate_model::contact;
pub use palpate_model::plane::{PlaneNow, planes};

/// Adds scale · Σ weight (u_a − 2u_b + u_c) of the ghost lines: the product with their matrix.
pub fn ghost_product(body: &Body, scale: f64, u: &[DVec3], out: &mut [DVec3]) {
    for g in &body.ghosts {
        let [a, b, c] = g.nodes.map(|n| n as usize);
        let s = scale * g.weight * (u[a] - 2.0 * u[b] + u[c]);
        out[a] += s;
        out[b] -= 2.0 * s;
        out[c] += s;
    }
}

/// A surface patch that touches a plane.
pub struct Touch<'a> {
    /// Nodes of the patch's cell.
    pub nodes: &'a [u32; 8],
    /// Shape function means over the patch.
    pub weights: &'a [f64; 8],
    /// Area [m²].
    pub area: f64,
    /// Where the patch's mean point is now [m].
    pub point: DVec3,
    /// Pressure [Pa].
    pub pressure: f64,
    /// Derivative of the pressure by the gap [Pa/m], negative.
    pub slope: f64,
    /// Gap: distance above the plane [m].
    pub gap: f64,
}

/// Patches that feel a plane at displacement u.
pub fn touches<'a>(body: &'a Body, plane: &'a PlaneNow, u: &'a [DVec3]) -> impl Iterator<Item = Touch<'a>> {
    patch_touches(body, plane, u).map(|(_, t)| t)
}

/// The same with the patch.
pub fn patch_touches<'a>(body: &'a Body, plane: &'a PlaneNow, u: &'a [DVec3]) -> impl Iterator<Item = (&'a Patch, Touch<'a>)> {
    let width = contact::WIDTH * body.grid.h;
    body.patches.iter().filter_map(move |patch| {
        let nodes = &body.cells[patch.cell as usize].nodes;
        let mut point = patch.point;
        for i in 0..8 {
            point += patch.weights[i] * u[nodes[i] as usize];
        }
        let gap = plane.normal[0].dot(point) - plane.height;
        (gap < width).then(|| {
            let (pressure, slope) = contact::pressure(gap, plane.stiffness, width);
            (patch, Touch { nodes, weights: &patch.weights, area: patch.area, point, pressure, slope, gap })
        })
    })
}
