//! Clamps (Nitsche), ghost penalty and contact planes: everything that pushes besides the cells and inertia.

use crate::passes::cells::Matrices;
use glam::{DMat3, DVec3};
use palpate_model::body::{Body, Patch};
use palpate_model::contact;
use palpate_model::corotation::{M24, V24, corners, flatten, multiply};
use palpate_model::elements::Elements;
use palpate_model::plan::{ClampCell, ClampSite, Plan, clamp_pose};
pub use palpate_model::plane::{PlaneNow, planes};

/// Rest position of corner i of a clamp cell.
fn rest(body: &Body, c: &ClampCell, i: usize) -> DVec3 {
    body.nodes[body.cells[c.cell as usize].nodes[i] as usize]
}

/// Displacement of a clamp cell's corners from where the clamp wants them, in the clamp's frame: Aᵀ(x − b) − X.
fn deviation(body: &Body, c: &ClampCell, pose: (DMat3, DVec3), u: &[DVec3]) -> V24 {
    let at = pose.0.transpose();
    let nodes = &body.cells[c.cell as usize].nodes;
    let mut d = [0.0; 24];
    for i in 0..8 {
        let x = rest(body, c, i);
        (at * (x + u[nodes[i] as usize] - pose.1) - x).write_to_slice(&mut d[3 * i..3 * i + 3]);
    }
    d
}

fn matrix(elements: &Elements, index: usize, cell: usize, which: Matrices) -> &M24 {
    let m = &elements.clamps[index][cell];
    match which {
        Matrices::Stiffness => &m.k,
        Matrices::ByPoisson => &m.k_nu,
    }
}

/// Adds the force of clamp `index` that stands in `pose`: A K (Aᵀ(x − b) − X), with matrices scaled by `young`.
pub fn clamp_force(
    plan: &Plan,
    index: usize,
    elements: &Elements,
    which: Matrices,
    pose: (DMat3, DVec3),
    young: f64,
    u: &[DVec3],
    out: &mut [DVec3],
) {
    let body = &plan.body;
    for (m, c) in plan.clamps[index].cells.iter().enumerate() {
        let f = multiply(matrix(elements, index, m, which), &deviation(body, c, pose, u));
        let nodes = &body.cells[c.cell as usize].nodes;
        for i in 0..8 {
            out[nodes[i] as usize] += young * (pose.0 * DVec3::from_slice(&f[3 * i..3 * i + 3]));
        }
    }
}

/// Adds A K Aᵀ du of clamp `index`, with the matrices scaled by `young`.
pub fn clamp_product(plan: &Plan, index: usize, elements: &Elements, turn: DMat3, young: f64, du: &[DVec3], out: &mut [DVec3]) {
    for (m, c) in plan.clamps[index].cells.iter().enumerate() {
        let nodes = &plan.body.cells[c.cell as usize].nodes;
        let d: [DVec3; 8] = nodes.map(|n| turn.transpose() * du[n as usize]);
        let f = corners(&multiply(matrix(elements, index, m, Matrices::Stiffness), &flatten(&d)));
        for i in 0..8 {
            out[nodes[i] as usize] += young * (turn * f[i]);
        }
    }
}

/// Energy [J] of clamp `index`, for line searches.
pub fn clamp_energy(plan: &Plan, index: usize, elements: &Elements, pose: (DMat3, DVec3), young: f64, u: &[DVec3]) -> f64 {
    let body = &plan.body;
    let energy = |(m, c): (usize, &ClampCell)| {
        let d = deviation(body, c, pose, u);
        let f = multiply(matrix(elements, index, m, Matrices::Stiffness), &d);
        0.5 * young * d.iter().zip(&f).map(|(d, f)| d * f).sum::<f64>()
    };
    plan.clamps[index].cells.iter().enumerate().map(energy).sum()
}

/// Pose of a clamp at a time on the recording's clock.
pub fn pose_at(clamp: &ClampSite, time: f64) -> (DMat3, DVec3) {
    clamp_pose(clamp.motion.as_ref(), time)
}

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
