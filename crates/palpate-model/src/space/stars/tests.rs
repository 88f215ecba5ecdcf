//! Clouds as bodies: conditions of the weights, fields that are carried, and what is refused.

use super::graph::{MOST, stars};
use super::*;
use crate::scene::Analytic;
use crate::shape::cloud::around;
use crate::shape::{MeshShape, Placed};
use glam::{DAffine3, DMat3};

/// A number from −½ to ½ (Weyl's sequence of three dimensions).
fn jitter(n: usize) -> DVec3 {
    (DVec3::new(0.8191725134, 0.6710436067, 0.5497004779) * (n as f64 + 1.0)).fract() - 0.5
}

/// Points of a lattice of so many, moved by up to a part of its edge, in the middles of the cubes of a box from the origin.
fn lattice(count: [usize; 3], edge: f64, by: f64) -> Vec<DVec3> {
    let at = |n: usize| [n % count[0], n / count[0] % count[1], n / (count[0] * count[1])].map(|k| k as f64 + 0.5);
    (0..count.iter().product()).map(|n| edge * (DVec3::from_array(at(n)) + 2.0 * by * jitter(n))).collect()
}

fn block(count: [usize; 3], edge: f64) -> Placed {
    let max = edge * DVec3::from_array(count.map(|n| n as f64));
    Placed::new(Analytic::Box { min: DVec3::ZERO, max }, DAffine3::IDENTITY)
}

fn body(weights: Weights, neighbours: usize) -> Body {
    let spec = StarSpec { weights, neighbours, ..StarSpec::default() };
    Body::of_stars(&lattice([7, 5, 4], 0.01, 0.25), &block([7, 5, 4], 0.01), &spec).unwrap()
}

/// A1: sums over a star, completeness, and sums over the stars of a point.
#[test]
fn weights_are_complete_and_compatible() {
    for neighbours in [6, 8, 12] {
        let body = body(Weights::Compatible, neighbours);
        let h = body.length;
        let mut columns = body.outward_areas();
        for (i, s) in body.points.stencils.iter().enumerate() {
            assert!((s.nodes.len() > neighbours && s.nodes.len() <= MOST + 1) && s.nodes[0] as usize == i);
            assert!(s.gradient.iter().copied().sum::<DVec3>().length() * h < 1e-12);
            let f = s.gradient_of(&body.nodes) - DMat3::IDENTITY;
            assert!(f.to_cols_array().iter().all(|x| x.abs() < 1e-12), "{f:?}");
            s.nodes.iter().zip(s.gradient).for_each(|(n, g)| columns[*n as usize] -= body.points.volume[i] * *g);
        }
        let worst = columns.iter().map(|c| c.length()).fold(0.0, f64::max) / (h * h);
        assert!(worst < 1e-10, "{worst}");
    }
    // Without them a constant stress is far from equilibrium.
    let body = body(Weights::Published, 6);
    let mut columns = body.outward_areas();
    for (s, v) in body.points.stencils.iter().zip(&body.points.volume) {
        s.nodes.iter().zip(s.gradient).for_each(|(n, g)| columns[*n as usize] -= *v * *g);
    }
    assert!(columns.iter().any(|c| c.length() > 0.1 * body.length.powi(2)));
}

#[test]
fn shares_make_the_whole() {
    let body = body(Weights::Compatible, 6);
    let whole = 7.0 * 5.0 * 4.0 * 1e-6;
    assert!((body.volume / whole - 1.0).abs() < 1e-12 && (body.node_volume.iter().sum::<f64>() / whole - 1.0).abs() < 1e-12);
    assert!(body.node_volume.iter().all(|v| *v > 0.0));
    let areas = body.outward_areas();
    assert!(areas.iter().copied().sum::<DVec3>().length() < 1e-15);
    // Σ x tᵀ = V I, as of any closed surface.
    let moment: f64 = areas.iter().zip(&body.nodes).map(|(t, x)| x.y * t.y).sum();
    assert!((moment / whole - 1.0).abs() < 1e-10, "{moment}");
    assert!(body.patches.is_sorted_by_key(|p| p.cell));
}

/// A penalty of zero on affine fields, and of more on others.
#[test]
fn only_what_is_not_affine_costs() {
    let body = body(Weights::Compatible, 6);
    let penalty = body.points.stars.as_ref().unwrap();
    let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
    let cost = |field: &dyn Fn(DVec3) -> DVec3| -> f64 {
        let u: Vec<DVec3> = body.nodes.iter().map(|x| field(*x)).collect();
        let of = |(i, s): (usize, crate::space::stencil::Stencil)| {
            let n = s.nodes.len();
            let entry = |k: usize| penalty.of(i)[k] * u[s.nodes[k / n] as usize].dot(u[s.nodes[k % n] as usize]);
            (0..n * n).map(entry).sum::<f64>()
        };
        body.points.stencils.iter().enumerate().map(of).sum()
    };
    assert!(cost(&|x| f * x + DVec3::Y).abs() < 1e-15);
    // Of the order of the volume for a strain of one that changes over a spacing.
    assert!(cost(&|x| DVec3::X * (x.z - 0.02).powi(2) / body.length) > 0.1 * body.volume);
}

#[test]
fn places_are_carried_by_what_is_around_them() {
    let body = body(Weights::Compatible, 6);
    let carrier = body.carrier();
    let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
    let affine: Vec<DVec3> = body.nodes.iter().map(|x| f * *x + DVec3::Y).collect();
    for x in [DVec3::new(0.031, 0.02, 0.02), DVec3::new(0.07, 0.05, 0.04), DVec3::new(0.03, 0.02, 0.055), body.nodes[40]] {
        let (s, away) = carrier.carry(x);
        assert!((s.get().at(&affine) - (f * x + DVec3::Y)).length() < 1e-13, "at {x}");
        assert!((s.get().gradient_of(&affine) - f).to_cols_array().iter().all(|e| e.abs() < 1e-10));
        assert!((away - (x.z - 0.04).max(0.0)).abs() < 1e-12, "{away} at {x}");
    }
    // Places in millimetres are far away, and some are no numbers: that is said, whoever asks decides.
    let (s, away) = carrier.carry(DVec3::new(300.0, 20.0, 20.0));
    assert!(away > 290.0 && s.get().at(&affine).is_finite(), "{away}");
    assert!(carrier.carry(DVec3::new(f64::NAN, 0.0, 0.0)).1.is_nan());
    // A point of the cloud follows itself.
    let bent: Vec<DVec3> = body.nodes.iter().map(|x| DVec3::Z * x.x * x.x).collect();
    assert!((carrier.carry(body.nodes[40]).0.get().at(&bent) - bent[40]).length() < 1e-15);
}

/// Around a cloud there is one closed surface with the right volume.
#[test]
fn a_surface_is_made_around_points() {
    let points = lattice([8, 5, 4], 0.01, 0.25);
    let whole = 8.0 * 5.0 * 4.0 * 1e-6;
    let chosen = around(&points, None).unwrap();
    // Rounded edges of a small body, and points that stick out by a quarter of their spacing.
    assert!((chosen.volume() / whole - 1.0).abs() < 0.1, "{}", chosen.volume() / whole);
    let stated = around(&points, Some(whole)).unwrap();
    assert!((stated.volume() / whole - 1.0).abs() < 1e-6, "{}", stated.volume());
    assert!(crate::shape::diagnose(&stated).is_closed());
    let (low, high) = stated.bounds();
    assert!(low.length() < 0.006 && (high - DVec3::new(0.08, 0.05, 0.04)).length() < 0.006, "{low} {high}");
    let body = Body::of_stars(&points, &MeshShape::new(stated), &StarSpec::default()).unwrap();
    assert!((body.volume / whole - 1.0).abs() < 1e-6);
    let e = around(&points, Some(1.0)).unwrap_err();
    assert!(e.contains("volume = 1 m³ is not what these points fill") && e.contains("check the unit"), "{e}");
    let mut two = points.clone();
    two.extend(points.iter().map(|x| *x + 0.2 * DVec3::X));
    assert!(around(&two, None).unwrap_err().contains("are of 2 bodies"));
}

#[test]
fn what_cannot_be_a_body_is_refused() {
    let points = lattice([4, 4, 4], 0.01, 0.2);
    let shape = block([4, 4, 4], 0.01);
    let error = |points: &[DVec3]| Body::of_stars(points, &shape, &StarSpec::default()).unwrap_err();
    assert_eq!(error(&points[..5]), "holds 5 points; a body needs 8 or more");
    let mut twice = points.clone();
    twice.push(points[9]);
    assert!(error(&twice).starts_with("2 of 65 points lie at the place of another one, points 9 and 64"), "{}", error(&twice));
    let mut broken = points.clone();
    broken[3].y = f64::NAN;
    assert!(error(&broken).starts_with("1 of 64 points are no numbers, point 3"));
    let mut stray = points.clone();
    stray.push(DVec3::splat(0.5));
    assert!(error(&stray).starts_with("1 of 65 points have no share of the inside, point 64"), "{}", error(&stray));
    // A sheet: however many neighbours, all lie in a plane.
    let sheet = lattice([6, 6, 1], 0.01, 0.0);
    let slab = block([6, 6, 1], 0.01);
    let e = Body::of_stars(&sheet, &slab, &StarSpec::default()).unwrap_err();
    assert!(e.starts_with("36 of 36 points have all their neighbours in about one plane"), "{e}");
    // Two layers far apart have neighbours in a plane first, and take more.
    let apart = DVec3::new(1.0, 1.0, 1.8);
    let layers: Vec<DVec3> = lattice([6, 6, 2], 0.01, 0.0).into_iter().map(|x| x * apart).collect();
    let slab = Placed::new(Analytic::Box { min: DVec3::ZERO, max: 0.01 * apart * DVec3::new(6.0, 6.0, 2.0) }, DAffine3::IDENTITY);
    let body = Body::of_stars(&layers, &slab, &StarSpec::default()).unwrap();
    // At the corners the layer above is near enough.
    let more = body.points.stencils.iter().filter(|s| s.nodes.len() > 7).count();
    assert!(more >= 2 * 4 * 4, "{more} of 72");
}

/// Points on both sides of a gap are no neighbours.
#[test]
fn stars_do_not_reach_across_a_gap() {
    let near_gap: Vec<DVec3> = lattice([4, 3, 3], 0.01, 0.1);
    let mut points = near_gap.clone();
    points.extend(near_gap.iter().map(|x| *x + DVec3::new(0.0, 0.038, 0.0)));
    let max = DVec3::new(0.04, 0.03, 0.03);
    let mut mesh = Placed::new(Analytic::Box { min: DVec3::ZERO, max }, DAffine3::IDENTITY).surface(0.01);
    let other = mesh.transformed(&DAffine3::from_translation(DVec3::new(0.0, 0.038, 0.0)));
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(other.vertices);
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    let shape = MeshShape::new(mesh);
    let e = stars(&points, &Near::new(&points, 0.01), &shape, 6, 0.01).unwrap_err();
    assert_eq!(e, "falls into 2 parts that are no neighbours, of 36, 36 points; give one body, without stray points");
}
