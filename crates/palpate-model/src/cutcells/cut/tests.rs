//! Integrals over cut cells against closed forms.

use super::*;
use glam::DAffine3;

/// A reproducible sequence in [0, 1) (golden-ratio steps), enough to vary positions and directions.
struct Spread(f64);

impl Spread {
    fn next(&mut self) -> f64 {
        self.0 = (self.0 + 0.618_033_988_749_894_8) % 1.0;
        self.0
    }

    /// A unit vector with no component below about 0.1, where the reference formula loses digits.
    fn direction(&mut self) -> DVec3 {
        let mut part = || {
            let s = if self.next() < 0.5 { -1.0 } else { 1.0 };
            s * (0.15 + 0.85 * self.next())
        };
        DVec3::new(part(), part(), part()).normalize()
    }
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

/// ∫ x^p y^q z^r over the unit cube below the plane n·x = d (n > 0), by inclusion–exclusion over the cube's corners: signed simplices
/// {n·s ≤ d − n·v, s ≥ 0} with ∫ s^p = t^(3+Σp) Π (p!/n^(p+1)) / (3+Σp)!. With `surface`, the same over the plane inside the cube.
fn reference(n: DVec3, d: f64, p: [usize; 3], surface: bool) -> f64 {
    let mut sum = 0.0;
    for corner in 0..8u32 {
        let v = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let sign = if corner.count_ones() % 2 == 0 { 1.0 } else { -1.0 };
        let t = d - n.dot(v);
        if t <= 0.0 {
            continue;
        }
        // (v + s)^p expanded: v is 0 or 1.
        for code in 0..27 {
            let k = [code % 3, code / 3 % 3, code / 9];
            let mut c = sign;
            for a in 0..3 {
                c *= if k[a] > p[a] || (v[a] == 0.0 && k[a] != p[a]) {
                    0.0
                } else {
                    factorial(p[a]) / (factorial(k[a]) * factorial(p[a] - k[a])) * factorial(k[a]) / n[a].powi(k[a] as i32 + 1)
                };
            }
            let order = k.iter().sum::<usize>() + if surface { 2 } else { 3 };
            sum += c * t.powi(order as i32) / factorial(order);
        }
    }
    sum
}

#[test]
fn planar_cuts_are_exact() {
    let mut spread = Spread(0.1);
    let h = 0.02;
    for case in 0..60 {
        let normal = spread.direction();
        let cell = [3, -5, 7];
        let low = DVec3::new(3.0, -5.0, 7.0) * h;
        let through = low + DVec3::new(spread.next(), spread.next(), spread.next()) * h;
        let distance = |p: DVec3| normal.dot(p - through);
        let lattice = Lattice { distance: &distance, h, subdivisions: 2 + 2 * (case % 3) };
        let cut = cut_cell(&lattice, cell, cell);
        // The reference wants a positive normal: mirrored coordinates m(ξ).
        let mirror = |x: DVec3| DVec3::from_array(std::array::from_fn(|a| if normal[a] < 0.0 { 1.0 - x[a] } else { x[a] }));
        let (n, d) = (normal.abs(), normal.abs().dot(mirror((through - low) / h)));
        for code in 0..27 {
            let p = [code % 3, code / 3 % 3, code / 9];
            let monomial = |x: DVec3| (0..3).map(|a| mirror(x)[a].powi(p[a] as i32)).product::<f64>();
            let sum: f64 = (0..27).map(|q| cut.weights[q] * monomial(POINTS27[q])).sum();
            let exact = reference(n, d, p, false);
            // Rounding: rules have 15 digits, the reference cancels up to four.
            assert!((sum - exact).abs() < 1e-10, "{normal} {p:?}: {sum} {exact}");
            if p.iter().all(|&p| p < 2) {
                let corner = |i: usize| monomial(DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64));
                let sum: f64 = cut.pieces.iter().flat_map(|s| (0..8).map(move |i| s.area * s.weights[i] * corner(i))).sum();
                let exact = reference(n, d, p, true) * h * h;
                assert!((sum - exact).abs() < 1e-10 * h * h, "{normal} {p:?}: {sum} {exact}");
            }
        }
        assert!((cut.fraction - reference(n, d, [0; 3], false)).abs() < 1e-10);
        assert!((cut.weights.iter().sum::<f64>() - cut.fraction).abs() < 1e-12);
        for s in &cut.pieces {
            assert!((s.normal - normal).length() < 1e-10 && normal.dot(s.point - through).abs() < 1e-12);
            assert!((s.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        assert!(cut.pieces.len() <= 8);
        // A held half of the same cell: moments of the clipped body agree with those of the two cuts by themselves.
        check_held(&lattice, cell, &cut, through, h);
    }
}

/// Cuts a cell's held moments in two by a plane along an axis; the halves add up to the cell's own integrals.
fn check_held(lattice: &Lattice, cell: [i64; 3], cut: &CellCut, through: DVec3, h: f64) {
    let turn = DAffine3::from_rotation_y(0.3);
    let split = turn.transform_point3(through).x;
    let part = |min: f64, max: f64| {
        let region = ClipBox { to_frame: turn, min: DVec3::new(min, -9.0, -9.0), max: DVec3::new(max, 9.0, 9.0) };
        let mut held = HeldMoments::default();
        held_moments(lattice, cell, cell, false, &region, &mut held);
        held
    };
    let (a, b) = (part(-9.0, split), part(split, 9.0));
    assert!(a.volume() > 0.0 || b.volume() > 0.0);
    let (held, other) = (a.weights(), b.weights());
    assert!((0..27).all(|q| (held[q] + other[q] - cut.weights[q]).abs() < 1e-10));
    for i in 0..8 {
        // Both boxes meet the body in the same section, seen from either side.
        assert!((a.surface_normal[i] + b.surface_normal[i]).length() < 1e-10 * h * h);
        let section: DVec3 = a.surface_mass[i].iter().sum::<f64>() * turn.inverse().transform_vector3(-DVec3::X);
        assert!((a.surface_normal[i] - section).length() < 1e-10 * h * h);
        for j in 0..8 {
            let exact: f64 =
                (0..27).map(|q| cut.weights[q] * shape_functions(POINTS27[q])[i] * shape_functions(POINTS27[q])[j]).sum();
            assert!((a.volume_mass[i][j] + b.volume_mass[i][j] - exact * h.powi(3)).abs() < 1e-10 * h.powi(3));
        }
        assert!((0..8).all(|j| (a.surface_mass[i][j] - b.surface_mass[i][j]).abs() < 1e-10 * h * h));
    }
}

#[test]
fn a_held_box_keeps_what_lies_on_its_faces() {
    // Body z < 0.5 in the unit cell; a clamp box whose top is the body's surface holds all of it up to the box's one face inside the cell.
    let distance = |p: DVec3| p.z - 0.5;
    let lattice = Lattice { distance: &distance, h: 1.0, subdivisions: 4 };
    let region = ClipBox { to_frame: DAffine3::IDENTITY, min: DVec3::ZERO, max: DVec3::new(0.25, 1.0, 0.5) };
    let mut held = HeldMoments::default();
    held_moments(&lattice, [0; 3], [0; 3], false, &region, &mut held);
    assert!((held.area() - 0.5).abs() < 1e-14 && (held.volume() - 0.125).abs() < 1e-14);
    let normal: DVec3 = held.surface_normal.iter().sum();
    assert!((normal + DVec3::X * 0.5).length() < 1e-14);
}

#[test]
fn faces_on_lattice_planes_belong_to_the_inside_cell() {
    let distance = |p: DVec3| p.x - 2.0;
    let lattice = Lattice { distance: &distance, h: 1.0, subdivisions: 4 };
    let inside = cut_cell(&lattice, [1, 0, 0], [1, 0, 0]);
    let outside = cut_cell(&lattice, [2, 0, 0], [2, 0, 0]);
    assert_eq!(inside.fraction, 1.0);
    assert_eq!(inside.weights, FULL_WEIGHTS);
    assert!((inside.pieces.iter().map(|p| p.area).sum::<f64>() - 1.0).abs() < 1e-14);
    assert_eq!(inside.pieces.len(), 4);
    assert_eq!(outside.fraction, 0.0);
    assert!(outside.pieces.is_empty());
}
