//! A turned body with the mesh, the points and the splats that it carries.

use super::Figures;
use crate::verify::scenes;
use glam::{DMat3, DQuat, DVec3};
use palpate_io::carried::Carried;
use palpate_model::mechanics::splat::{FUNCTIONS, harmonics};
use palpate_model::plan::build::build_body;
use palpate_model::scene::Analytic;
use palpate_model::shape::TriMesh;
use rand::{RngExt, SeedableRng};
use std::path::Path;
use std::time::Instant;

/// Splats.
const COUNT: usize = 100_000;
/// Numbers of a splat: place, normal, colour, harmonics, opacity, scales, rotation.
const NUMBERS: usize = 9 + 3 * FUNCTIONS + 8;

fn of(row: &[f32], at: usize) -> DVec3 {
    DVec3::new(f64::from(row[at]), f64::from(row[at + 1]), f64::from(row[at + 2]))
}

fn covariance(row: &[f32]) -> DMat3 {
    let [w, x, y, z] = [0, 1, 2, 3].map(|k| f64::from(row[NUMBERS - 4 + k]));
    let (r, s) = (DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()), of(row, NUMBERS - 7).exp());
    r * DMat3::from_diagonal(s * s) * r.transpose()
}

fn colour(row: &[f32], d: DVec3) -> f64 {
    harmonics(d).iter().zip(&row[9..]).map(|(h, c)| h * f64::from(*c)).sum()
}

/// Rows of a splat file.
fn rows(bytes: &[u8]) -> Vec<Vec<f32>> {
    let body = &bytes[bytes.len() - 4 * NUMBERS * COUNT..];
    let row = |b: &[u8]| b.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    body.chunks_exact(4 * NUMBERS).map(row).collect()
}

/// The case.
pub fn run(folder: &Path) -> Result<Figures, String> {
    let text = |e: &dyn std::fmt::Display| e.to_string();
    let torus = Analytic::Torus { major: 0.05, minor: 0.02, center: DVec3::ZERO, axis: DVec3::Z };
    let (body, shape) = build_body(&scenes::body(torus, 0.008)).map_err(|e| text(&e))?;
    let size = (body.corners.1 - body.corners.0).max_element();
    let (turn, away) = (DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9), DVec3::new(0.3, -0.2, 0.1));
    let moved = |x: DVec3| turn * x + away;
    let u: Vec<DVec3> = body.nodes.iter().map(|x| moved(*x) - *x).collect();

    // A mesh a little outside the body, as scans are.
    let mut mesh = shape.surface(0.004);
    mesh.vertices.iter_mut().for_each(|v| *v += 0.003 * (1.0 + (300.0 * v.x).sin()) * v.normalize());
    let (from, to) = (folder.join("mesh.ply"), folder.join("moved.ply"));
    palpate_io::write_ply(&from, &TriMesh { ..mesh.clone() }).map_err(|e| text(&e))?;
    let carry = |from: &Path, to: &Path| -> Result<f64, String> {
        let file = Carried::read(from).map_err(|e| text(&e))?;
        let (places, followers) = (file.places().to_vec(), body.followers(file.places()));
        let clock = Instant::now();
        let at = |i: usize| {
            let s = followers.stencils.get(i);
            (places[i] + s.at(&u), DMat3::IDENTITY + s.gradient_of(&u))
        };
        file.write(to, at).map_err(|e| text(&e))?;
        Ok(clock.elapsed().as_secs_f64())
    };
    carry(&from, &to)?;
    let after = Carried::read(&to).map_err(|e| text(&e))?;
    let off = after.places().iter().zip(&mesh.vertices).map(|(a, x)| a.distance(moved(*x))).fold(0.0, f64::max);

    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).into_iter();
    let names = names.chain((0..3 * FUNCTIONS).map(|k| format!("f_rest_{k}")));
    let names = names.chain(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(String::from));
    let head: String = names.map(|n| format!("property float {n}\n")).collect();
    let mut bytes = format!("ply\nformat binary_little_endian 1.0\nelement vertex {COUNT}\n{head}end_header\n").into_bytes();
    for k in 0..COUNT {
        let mut row: Vec<f32> = (0..NUMBERS).map(|_| random.random_range(-1.0..1.0)).collect();
        // On the surface, give or take a tenth of the body.
        let p = mesh.vertices[k % mesh.vertices.len()];
        (0..3).for_each(|a| row[a] = p[a] as f32 + 0.005 * row[a]);
        (0..3).for_each(|a| row[NUMBERS - 7 + a] -= 6.0);
        row.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    let (from, to) = (folder.join("splats.ply"), folder.join("turned.ply"));
    std::fs::write(&from, &bytes).map_err(|e| text(&e))?;
    let seconds = carry(&from, &to)?;
    let after = rows(&std::fs::read(&to).map_err(|e| text(&e))?);
    let (mut place, mut spread, mut shade) = (0.0f64, 0.0f64, 0.0f64);
    for (a, b) in after.iter().zip(rows(&bytes)) {
        place = place.max(of(a, 0).distance(moved(of(&b, 0))));
        let (found, wanted) = (covariance(a), turn * covariance(&b) * turn.transpose());
        let largest = wanted.to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let off = (found - wanted).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
        spread = spread.max(off / largest);
        let d = DVec3::new(0.36, -0.48, 0.8);
        shade = shade.max((colour(a, turn * d) - colour(&b, d)).abs());
    }
    Ok(Figures::from([
        ("mesh: error over size".into(), off / size),
        ("splats: error of the places over size".into(), place / size),
        ("splats: error of the covariance over its size".into(), spread),
        ("splats: error of the colour".into(), shade),
        ("seconds a frame of 100000 splats".into(), seconds),
    ]))
}
