//! Every law of the table against central differences, at random states.

use super::law::{Asks, COMMON, Followed, PLANE, Place, Point, STIFFNESS, TIME};
use super::{ALL, Law, Site, Unstated};
use crate::mechanics::rotation::tests::Noise;
use glam::DVec3;

/// The point laws of the table.
fn point_laws() -> impl Iterator<Item = (&'static Law, &'static dyn Point)> {
    ALL.iter().filter_map(|l| match l.site {
        Site::Nodes(p) | Site::Surface(p) | Site::Contact(p) | Site::Driven(p) => Some((l, p)),
        _ => None,
    })
}

/// A place and input at which the law does something: a patch that touches a plane, slides and has been there before.
fn state(law: &Law, noise: &mut Noise) -> (Place, Vec<f64>) {
    let normal = noise.vector(1.0).normalize();
    let width = 1e-3;
    let height = noise.uniform(-0.1, 0.1);
    let across = normal.cross(noise.vector(1.0));
    let old = normal * (height + width * noise.uniform(-2.0, 0.8)) + across * 0.02;
    let x = old + 2e-4 * noise.vector(1.0);
    let mut place = Place {
        rest: old + 0.01 * noise.vector(1.0),
        normal: noise.vector(1.0).normalize(),
        measure: noise.uniform(0.5, 2.0),
        width,
        rate: 100.0,
        inertia: 1e4 / 0.6,
        momentum: 1e2 / 0.55,
        followed: Followed::default(),
    };
    let mut z = vec![0.0; COMMON + law.params.len()];
    let velocity = noise.vector(1.0);
    let gravity = noise.vector(9.81);
    for i in 0..3 {
        (z[i], z[3 + i], z[6 + i], z[9 + i], z[PLANE + i]) = (x[i], old[i], velocity[i], gravity[i], normal[i]);
    }
    (z[STIFFNESS], z[PLANE + 3], z[PLANE + 4]) = (3e5, height, 2e5);
    z[TIME] = noise.uniform(0.0, 1.0);
    for (p, v) in law.params.iter().zip(&mut z[COMMON..]) {
        *v = match p.default {
            // Places: somewhere near the point.
            Unstated::Center | Unstated::Reference | Unstated::OnBody => {
                old[usize::from(p.axis.unwrap_or(0))] + 0.01 * noise.uniform(-1.0, 1.0)
            }
            _ => (p.typical * noise.uniform(0.3, 1.5)).clamp(p.lower.max(-1e9), p.upper.min(1e9)),
        };
    }
    if law.asks() == Asks::Series {
        let of = |noise: &mut Noise| [noise.vector(0.1), noise.vector(0.5)];
        place.followed = Followed { time: z[TIME], new: of(noise), old: of(noise) };
    }
    if law.asks() == Asks::Path {
        // A ball that the point is about to touch, moving.
        let side = noise.vector(1.0).normalize() * z[COMMON + 1].min(0.05);
        let near = |x: DVec3, noise: &mut Noise| x - side * (1.0 + noise.uniform(-0.01, 0.003));
        let new = [near(x, noise), noise.vector(0.5)];
        place.followed = Followed { time: z[TIME], new, old: [near(old, noise), noise.vector(0.5)] };
    }
    (place, z)
}

/// Central difference of a vector function along `d`, with a step that suits the size of each entry.
fn difference<const M: usize>(z: &[f64], d: &[f64], step: f64, f: impl Fn(&[f64]) -> [f64; M]) -> [f64; M] {
    let moved = |s: f64| f(&z.iter().zip(d).map(|(z, d)| z + s * d).collect::<Vec<_>>());
    let (a, b) = (moved(step), moved(-step));
    std::array::from_fn(|i| (a[i] - b[i]) / (2.0 * step))
}

#[test]
fn derivatives_match_central_differences() {
    let mut noise = Noise(7);
    for (law, point) in point_laws() {
        let mut acting = 0;
        // Laws of rare touches get more tries.
        for _ in 0..4000 {
            if acting == 200 {
                break;
            }
            let (place, z) = state(law, &mut noise);
            if point.skips(&place, &z) {
                assert_eq!(point.gradient(&place, &z), [0.0; 3], "{}: an idle point feels a force", law.kind);
                continue;
            }
            acting += 1;
            // Entries by their own size: a step of 1e-6 of that leaves a truncation of some 1e-9 and rounding of 1e-10.
            let sizes: Vec<f64> =
                z.iter().enumerate().map(|(i, v)| if i < 6 { place.width } else { v.abs().max(1e-3) }).collect();
            let d: Vec<f64> = sizes.iter().map(|s| s * noise.uniform(-1.0, 1.0)).collect();
            let gradient = point.gradient(&place, &z);
            let force = gradient.iter().map(|g| g.abs()).fold(1e-12, f64::max);
            for i in 0..3 {
                let mut e = vec![0.0; z.len()];
                e[i] = place.width;
                let fd = difference(&z, &e, 1e-4, |z| [point.value(&place, z)])[0] / place.width;
                // At grazing contact the force is of third order in the depth, and so is what a difference leaves.
                let grazing = 1e-5 * z[STIFFNESS] * place.width;
                let size = force.max(1e-9 * point.value(&place, &z).abs() / place.width / 1e-4).max(grazing);
                assert!((fd - gradient[i]).abs() < 1e-5 * size, "{}: force {fd} {}", law.kind, gradient[i]);
            }
            let along = point.along(&place, &z, &d);
            let fd = difference(&z, &d, 1e-6, |z| point.gradient(&place, z));
            // Positions of 0.1 m round to 1e-17 m, which a stiff contact turns into a force.
            let rounding = 1e-17 * z[STIFFNESS] / 1e-6 / 1e-6;
            let size = along.iter().map(|g| g.abs()).fold(force.max(rounding), f64::max);
            for i in 0..3 {
                // A contact that has just begun, s of its blend deep, goes with s³: the difference misses (1e-6 · 0.1 m / 2 w s)² of it.
                assert!((fd[i] - along[i]).abs() < 5e-6 * size, "{}: {fd:?} {along:?}", law.kind);
            }
            let twice = point.gradient(&Place { measure: 2.0 * place.measure, ..place }, &z);
            assert!((0..3).all(|i| (twice[i] - 2.0 * gradient[i]).abs() <= 1e-12 * force), "{}: measure", law.kind);
            let hessian = point.hessian(&place, &z);
            let dx = [d[0], d[1], d[2]];
            let mut only_x = vec![0.0; z.len()];
            only_x[..3].copy_from_slice(&dx);
            let product = point.along(&place, &z, &only_x);
            for i in 0..3 {
                let h: f64 = (0..3).map(|j| hessian[i][j] * dx[j]).sum();
                assert!((h - product[i]).abs() <= 1e-12 * size, "{}: Hessian", law.kind);
            }
            if point.is_load() {
                let mut past = [0.0; 6];
                point.transposed(&place, &z, [1.0, -0.7, 0.4], 3..9, &mut past);
                assert!(hessian == [[0.0; 3]; 3] && past == [0.0; 6], "{}: a load depends on states", law.kind);
            }
            let w = noise.vector(1.0).to_array();
            let mut row = vec![0.0; z.len()];
            point.transposed(&place, &z, w, 0..z.len(), &mut row);
            let (left, right) =
                (row.iter().zip(&d).map(|(r, d)| r * d).sum::<f64>(), w.iter().zip(&along).map(|(w, a)| w * a).sum::<f64>());
            assert!((left - right).abs() <= 1e-11 * size, "{}: transposed {left} {right}", law.kind);
        }
        assert!(acting >= 50, "{}: only {acting} of 4000 random states feel it", law.kind);
    }
}

#[test]
fn shares_derive() {
    let mut noise = Noise(8);
    for (law, point) in point_laws() {
        let (_, z) = state(law, &mut noise);
        let (rest, p) = (DVec3::new(z[0], z[1], z[2]), &z[COMMON..]);
        let Some((_, slopes)) = point.shared(rest, p) else { continue };
        for i in 0..p.len() {
            let mut e = vec![0.0; p.len()];
            e[i] = p[i].abs().max(1e-3);
            let fd = difference(p, &e, 1e-6, |p| [point.shared(rest, p).expect("it shares").0])[0] / e[i];
            assert!((fd - slopes[i]).abs() < 1e-6 * (slopes[i].abs() + 1.0 / e[i]), "{}: {fd} {}", law.kind, slopes[i]);
        }
    }
}

#[test]
fn names_are_unique_and_absent_values_lie_within_bounds() {
    for (i, law) in ALL.iter().enumerate() {
        assert!(ALL[..i].iter().all(|o| o.kind != law.kind), "{} twice", law.kind);
        assert!(law.params.len() <= super::law::MOST, "{}", law.kind);
        assert!(!law.params.is_empty() && !law.sentence.ends_with('.'));
        for (k, p) in law.params.iter().enumerate() {
            assert!(law.params[..k].iter().all(|o| (o.key, o.axis) != (p.key, p.axis)), "{}: {} twice", law.kind, p.key);
            if let Unstated::Absent(v) | Unstated::Fixed(v) | Unstated::Stated(v) = p.default {
                assert!((p.lower..=p.upper).contains(&v), "{}: {}", law.kind, p.key);
            }
        }
        // A vector is written as one key with three components in order.
        let axes: Vec<_> = law.params.iter().filter_map(|p| p.axis.map(|a| (p.key, a))).collect();
        assert!(axes.chunks(3).all(|c| c.len() == 3 && (0..3).all(|a| c[a] == (c[0].0, a as u8))), "{}", law.kind);
    }
}
