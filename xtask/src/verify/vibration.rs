//! NAFEMS FV42: uniform radial vibration of a thick hollow sphere, a free body.

use super::linear;
use super::report::{Requirement, Row};
use super::scenes;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::scene::{BodySource, Inertia, Time};
use palpate_model::shape::{MeshShape, TriMesh};
use std::collections::BTreeMap;
use std::sync::Arc;

const INNER: f64 = 1.8;
const OUTER: f64 = 6.0;
/// Its first frequency [Hz].
const FIRST: f64 = 369.91;

/// A ball's surface by halving the edges of an octahedron, with the ball's volume.
fn surface(radius: f64, halvings: usize) -> TriMesh {
    let vertices = DVec3::AXES.iter().flat_map(|a| [*a, -*a]).collect();
    let mut mesh = TriMesh { vertices, triangles: Vec::new() };
    for (x, y, z) in (0..8u32).map(|k| (k & 1, 2 + (k >> 1 & 1), 4 + (k >> 2))) {
        let odd = (x + y + z) % 2 == 1;
        mesh.triangles.push(if odd { [x, z, y] } else { [x, y, z] });
    }
    for _ in 0..halvings {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
        for [a, b, c] in &mesh.triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                    mesh.vertices.push((mesh.vertices[i as usize] + mesh.vertices[j as usize]).normalize());
                    mesh.vertices.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(*a, *b), middle(*b, *c), middle(*c, *a));
            triangles.extend([[*a, ab, ca], [*b, bc, ab], [*c, ca, bc], [ab, bc, ca]]);
        }
        mesh.triangles = triangles;
    }
    let scale = radius * (4.0 / 3.0 * std::f64::consts::PI / mesh.volume()).cbrt();
    mesh.vertices.iter_mut().for_each(|v| *v *= scale);
    mesh
}

/// The frequency on cells of an edge [m].
fn frequency(cell: f64) -> Result<f64, String> {
    let (mut mesh, inner) = (surface(OUTER, 5), surface(INNER, 4));
    let n = mesh.vertices.len() as u32;
    mesh.vertices.extend(inner.vertices);
    mesh.triangles.extend(inner.triangles.iter().map(|[a, b, c]| [a + n, c + n, b + n]));
    let mut s =
        scenes::of(BodySource::Mesh { path: "fv42.obj".into(), shape: Arc::new(MeshShape::new(mesh)), open_edges: 0 }, cell);
    s.material.youngs_modulus = 2e11;
    s.material.inertia = Inertia::Density(8000.0);
    s.time = Time { steps: 1, ..s.time };
    let plan = scenes::plan(&s)?;
    let mut world = CpuBackend.build(&plan, 1).map_err(|e| e.to_string())?;
    CpuBackend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let blocks = CpuBackend.statics(&mut world, &vec![DVec3::ZERO; plan.body.nodes.len()], 0).1;
    let masses: Vec<f64> = plan.body.node_volume.iter().map(|v| 8000.0 * v).collect();
    // Inverse iteration, shifted so that a free body has a factor: other radial modes, from 838 Hz on, lose two thirds in every pass, and
    // the lattice's symmetry keeps all others out but those with the symmetry of a cube.
    let shift = (std::f64::consts::TAU * FIRST).powi(2);
    let springs: Vec<f64> = masses.iter().map(|m| shift * m).collect();
    let factor = linear::factorise(&blocks, &springs)?;
    let mut u = plan.body.nodes.clone();
    let mut square = f64::NAN;
    for _ in 0..8 {
        let load: Vec<DVec3> = u.iter().zip(&masses).map(|(u, m)| *m * *u).collect();
        let next = linear::solve(&factor, &load);
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let heavy: Vec<DVec3> = next.iter().zip(&masses).map(|(u, m)| *m * *u).collect();
        // (K + σM) x = M u.
        square = dot(&next, &load) / dot(&next, &heavy) - shift;
        let size = dot(&next, &heavy).sqrt();
        u = next.iter().map(|u| *u / size).collect();
    }
    Ok(square.sqrt() / std::f64::consts::TAU)
}

/// The study.
///
/// # Errors
/// The sphere cannot be cut or its matrix not be factorised.
pub fn run() -> Result<Vec<Row>, String> {
    let source = "NAFEMS FV42, *The Standard NAFEMS Benchmarks*, TNSB rev. 3, 1990";
    let row = |cell: f64, part| {
        let requirement = Requirement::Within { value: FIRST, part };
        Ok(Row::new(format!("first radial frequency, cells of {cell} m"), requirement, frequency(cell)?, "Hz", source))
    };
    [(1.0, 0.02), (0.6, 0.01)].into_iter().map(|(cell, part)| row(cell, part)).collect()
}
