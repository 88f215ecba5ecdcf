//! Cook's membrane: a tapered panel, held on the left and sheared on the right, as a thin solid.

use super::report::{Requirement, Row};
use super::scenes;
use glam::{DAffine3, DVec3};
use palpate_model::scene::{BodySource, Clamp, InitialShape, PointMass};
use palpate_model::shape::{MeshShape, TriMesh};
use std::sync::Arc;

/// Thickness, in the panel's own units (48 wide, 44 high at its root and 16 at its end).
const THICK: f64 = 2.0;
/// What is in the clamp.
const ROOT: f64 = 4.0;

/// The panel, extruded along z from 0.
fn panel() -> TriMesh {
    // From the root on against the clock; the root goes on at its height inside the clamp.
    let outline = [[-ROOT, 0.0], [0.0, 0.0], [48.0, 44.0], [48.0, 60.0], [0.0, 44.0], [-ROOT, 44.0]];
    let n = outline.len() as u32;
    let at = |z: f64| outline.map(|[x, y]| DVec3::new(x, y, z));
    let vertices = [at(0.0), at(THICK)].concat();
    // Two quadrangles.
    let faces = [[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]];
    let mut triangles: Vec<[u32; 3]> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    triangles.extend(faces.iter().map(|f| f.map(|v| v + n)));
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, j + n], [i, j + n, i + n]]);
    }
    TriMesh { vertices, triangles }
}

/// Vertical displacement of the middle of the right edge for E = 1, a load of 1 per thickness, of the small load that keeps it linear.
fn deflect(cell: f64) -> Result<f64, String> {
    let mesh = panel();
    let source = BodySource::Mesh { path: "cook.obj".into(), shape: Arc::new(MeshShape::new(mesh)), open_edges: 0 };
    let mut s = scenes::of(source, cell);
    s.object.pose = DAffine3::IDENTITY;
    s.material.youngs_modulus = 1.0;
    s.material.poisson_ratio = 1.0 / 3.0;
    // A ten-thousandth of the load, by weights that hang upwards along the right face; the panel weighs a millionth of them.
    let load = 1e-4;
    s.material.inertia = palpate_model::scene::Inertia::Density(1e-3);
    let weight = 1e6;
    s.gravity = DVec3::new(0.0, load / weight, 0.0);
    let [rows, columns] = [32, 2];
    for (i, j) in (0..rows * columns).map(|k| (k / columns, k % columns)) {
        let y = 44.0 + 16.0 * (f64::from(i) + 0.5) / f64::from(rows);
        let z = THICK * (f64::from(j) + 0.5) / f64::from(columns);
        s.masses.push(PointMass { point: DVec3::new(48.0, y, z), mass: weight * THICK / f64::from(rows * columns) });
    }
    s.clamps = vec![Clamp::still(DVec3::splat(-99.0), DVec3::new(0.0, 99.0, 99.0))];
    s.initial.state = InitialShape::StaticEquilibrium;
    let (plan, state) = scenes::end(&s)?;
    let middle = DVec3::new(48.0, 52.0, 0.5 * THICK);
    let (mut sum, mut area) = (0.0, 0.0);
    // The mean over the face's middle fifth of its height is the middle's to second order.
    for (patch, place) in plan.body.pieces().filter(|(p, _)| p.normal.x > 0.99 && (p.point.y - middle.y).abs() < 1.6) {
        sum += patch.area * place.at(&state.displacement).y;
        area += patch.area;
    }
    Ok(sum / area / load)
}

/// The study.
///
/// # Errors
/// The panel has no equilibrium.
pub fn run() -> Result<Vec<Row>, String> {
    let source = "plane stress, converged value of the literature (Cook, *J. Struct. Div. ASCE* 100, 1974)";
    let row = |cell: f64, part| {
        let requirement = Requirement::Within { value: 23.96, part };
        Ok(Row::new(format!("middle of the right edge, cells of {cell}"), requirement, deflect(cell)?, "", source))
    };
    [(2.0, 0.03), (1.0, 0.015)].into_iter().map(|(cell, part)| row(cell, part)).collect()
}
