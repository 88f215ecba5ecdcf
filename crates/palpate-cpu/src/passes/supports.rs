//! Ghost penalty and contact planes: what pushes besides cells, clamps and inertia.

use glam::DVec3;
use palpate_model::mechanics::contact;
pub use palpate_model::mechanics::plane::{PlaneNow, planes};
use palpate_model::space::body::{Body, Patch};

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

/// A surface patch that touches a plane within a step: sums over the instants of [`contact::instants`].
pub struct Touch<'a> {
    /// Nodes of the patch's cell.
    pub nodes: &'a [u32; 8],
    /// Shape function means over the patch.
    pub weights: &'a [f64; 8],
    /// Area [m²].
    pub area: f64,
    /// Pressure [Pa].
    pub pressure: f64,
    /// Its derivatives by the new and by the old gap [Pa/m], negative.
    pub slopes: [f64; 2],
    /// Slope of the law times the place of the patch's mean point [Pa]: derivative of the pressure by the plane's normal.
    pub lever: DVec3,
    /// Potential per area whose derivative by the new gap is minus the pressure [J/m²].
    pub energy: f64,
}

/// What happens between a body and a plane in one balance.
#[derive(Clone, Copy)]
pub struct Contact<'a> {
    /// The body.
    pub body: &'a Body,
    /// The plane.
    pub plane: &'a PlaneNow,
    /// Weight θ of the new state.
    pub theta: f64,
    /// New and old displacement.
    pub u: [&'a [DVec3]; 2],
}

impl<'a> Contact<'a> {
    /// Patches that feel the plane.
    pub fn touches(self) -> impl Iterator<Item = (&'a Patch, Touch<'a>)> {
        let Contact { body, plane, theta, u: [u1, u0] } = self;
        let width = contact::WIDTH * body.grid.h;
        let instants = contact::instants(theta);
        let along = contact::acts_along(theta);
        body.patches.iter().filter_map(move |patch| {
            let nodes = &body.cells[patch.cell as usize].nodes;
            let at = |u: &[DVec3]| (0..8).fold(patch.point, |x, i| x + patch.weights[i] * u[nodes[i] as usize]);
            let new = at(u1);
            let old = if along { at(u0) } else { new };
            let n = plane.normal[0];
            if n.dot(new).min(n.dot(old)) - plane.height >= width {
                return None;
            }
            let gaps = [new, old].map(|x| n.dot(x) - plane.height);
            let mut t = Touch {
                nodes,
                weights: &patch.weights,
                area: patch.area,
                pressure: 0.0,
                slopes: [0.0; 2],
                lever: DVec3::ZERO,
                energy: 0.0,
            };
            for (weight, at) in instants.into_iter().filter(|i| i.0 > 0.0) {
                let gap = gaps[0] + (1.0 - at) * (gaps[1] - gaps[0]);
                let (pressure, slope) = contact::pressure(gap, plane.stiffness, width);
                t.pressure += weight * pressure;
                t.slopes[0] += weight * at * slope;
                t.slopes[1] += weight * (1.0 - at) * slope;
                t.lever += weight * slope * (new + (1.0 - at) * (old - new));
                t.energy += weight / at * contact::energy(gap, plane.stiffness, width);
            }
            (t.energy > 0.0).then_some((patch, t))
        })
    }
}
