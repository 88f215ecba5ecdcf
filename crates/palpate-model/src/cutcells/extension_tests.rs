//! Affine fields continued exactly, and the weights' properties.

use super::*;
use crate::scene::Analytic;
use crate::shape::Placed;
use glam::{DAffine3, DQuat};

fn shapes() -> Vec<Placed> {
    let tilt = DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.4), DVec3::new(0.3, 0.1, -0.2));
    [
        Analytic::Ball { radius: 0.3, center: DVec3::ZERO },
        // Thinner than a cell, and tilted.
        Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.6, 0.5, 0.04) },
        Analytic::Torus { major: 0.3, minor: 0.1, center: DVec3::ZERO, axis: DVec3::Y },
        // Thinner than a cell in two directions.
        Analytic::Cylinder { radius: 0.04, height: 0.9, center: DVec3::ZERO, axis: DVec3::new(0.1, 0.2, 1.0) },
    ]
    .map(|a| Placed::new(a, tilt))
    .to_vec()
}

#[test]
fn affine_fields_are_continued_exactly() {
    for shape in shapes() {
        let body = Body::build(&shape, 0.07, 0.28, 4).unwrap();
        let band = &body.band;
        assert!(!band.nodes.is_empty() && band.rows.len() == band.nodes.len() + 1);
        for (m, x) in band.nodes.iter().enumerate() {
            let row = band.rows[m] as usize..band.rows[m + 1] as usize;
            let sum: f64 = band.values[row.clone()].iter().sum();
            let point: DVec3 = row.map(|k| body.nodes[band.columns[k] as usize] * band.values[k]).sum();
            assert!((sum - 1.0).abs() < 1e-10 && (point - *x).length() < 1e-10, "{shape:?} {x}: {sum} {point}");
        }
    }
}

#[test]
fn weights_stay_moderate() {
    // The sum of absolute weights bounds how much noise of the nodes is amplified. A fit of radius R continued to a distance L grows
    // like 1 + c L/R; at four cells and R = 2.5 that is below 20 even on the thin bodies.
    for shape in shapes() {
        let body = Body::build(&shape, 0.07, 0.28, 4).unwrap();
        let band = &body.band;
        for m in 0..band.nodes.len() {
            let row = band.rows[m] as usize..band.rows[m + 1] as usize;
            let size: f64 = band.values[row].iter().map(|v| v.abs()).sum();
            assert!(size < 20.0, "{shape:?}: {size}");
        }
    }
}

#[test]
fn band_holds_every_point_near_the_surface() {
    for shape in shapes() {
        let (h, width) = (0.07, 0.15);
        let body = Body::build(&shape, h, width, 4).unwrap();
        let band = &body.band;
        let find =
            |c: [usize; 3]| band.cells.binary_search_by_key(&body.cut().grid.index(c), |b| body.cut().grid.index(b.lattice)).ok();
        let (lo, hi) = shape.bounds();
        let mut inside = 0;
        for i in 0..4000 {
            let t = f64::from(i);
            let u = DVec3::new((t * 0.618_034).fract(), (t * 0.754_877).fract(), (t * 0.569_840).fract());
            let p = lo - 0.25 + (hi - lo + 0.5) * u;
            if shape.signed_distance(p) < width {
                let (c, xi) = body.cut().grid.locate(p).unwrap();
                let cell = &band.cells[find(c).expect("a point in the band lies in a band cell")];
                inside += 1;
                // The nearest of the samples is off by at most the distance to it.
                let steps = STEPS as f64;
                let nearest = (0..3).map(|a| ((steps * xi[a]).round() as usize) * SAMPLES.pow(a as u32)).sum::<usize>();
                assert!((cell.sdf[nearest] - shape.signed_distance(p)).abs() <= 0.9 * h / steps);
            }
        }
        assert!(inside > 200);
        for c in &band.cells {
            for (i, o) in CORNERS.iter().enumerate() {
                let x = body.cut().grid.position(std::array::from_fn(|a| c.lattice[a] + o[a] as usize));
                let n = c.nodes[i] as usize;
                let y = if n < body.nodes.len() { body.nodes[n] } else { band.nodes[n - body.nodes.len()] };
                assert_eq!(x, y);
                let q = (0..3).map(|a| o[a] as usize * STEPS * SAMPLES.pow(a as u32)).sum::<usize>();
                assert!((c.sdf[q] - shape.signed_distance(x)).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn marker_weights_follow_affine_motion() {
    for shape in shapes() {
        let body = Body::build(&shape, 0.07, 0.07, 4).unwrap();
        let lookup = NodeLookup::new(&body);
        let f = glam::DMat3::from_cols(DVec3::new(1.1, 0.2, 0.0), DVec3::new(-0.3, 0.9, 0.1), DVec3::new(0.0, 0.4, 1.2));
        let shift = DVec3::new(3.0, -1.0, 0.5);
        for away in [0.0, 0.1] {
            let p = shape.closest_point(body.center + DVec3::new(0.2, 0.3, 1.0)) + DVec3::splat(away);
            let w = affine_weights(&body, &lookup, p, 0.14);
            let site = crate::observation::MarkerSite { stencil: w, ..Default::default() };
            let (x, g) = site.carry(|n| f * body.nodes[n] + shift);
            assert!((x - (f * p + shift)).length() < 1e-10, "{x}");
            assert!((0..3).all(|c| (g.col(c) - f.col(c)).length() < 1e-9), "{g}");
        }
    }
}
