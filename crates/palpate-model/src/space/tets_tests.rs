//! Fields, shares, masses and places of bodies of tetrahedra.

use super::*;
use crate::space::points::Share;
use crate::space::points::tests::block;

fn bodies() -> [Body; 2] {
    let mesh = block().checked().unwrap();
    [Tetrahedron::Linear, Tetrahedron::Quadratic].map(|kind| Body::of_tets(&mesh, kind))
}

/// A field of second degree and its gradient.
fn bowl(x: DVec3) -> (DVec3, DMat3) {
    let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
    let at = f * x + DVec3::new(3.0 * x.x * x.y, 2.0 * x.z * x.z - x.x * x.x, x.y * x.z);
    let rows = [DVec3::new(3.0 * x.y, 3.0 * x.x, 0.0), DVec3::new(-2.0 * x.x, 0.0, 4.0 * x.z), DVec3::new(0.0, x.z, x.y)];
    (at, f + DMat3::from_cols(rows[0], rows[1], rows[2]).transpose())
}

#[test]
fn a_block_has_its_volume_surface_and_masses() {
    for (body, nodes) in bodies().into_iter().zip([12, 12 + 33]) {
        assert_eq!((body.nodes.len(), body.elements()), (nodes, 12));
        assert!((body.volume - 0.002).abs() < 1e-17 && body.node_volume.iter().all(|v| *v > 0.0));
        assert!((body.node_volume.iter().sum::<f64>() - 0.002).abs() < 1e-17 && (body.area - 0.1).abs() < 1e-15);
        let center: DVec3 = body.nodes.iter().zip(&body.node_volume).map(|(x, v)| *x * *v).sum::<DVec3>() / body.volume;
        assert!((center - DVec3::new(0.1, 0.05, 0.05)).length() < 1e-15 && (center - body.center).length() < 1e-15);
        for (p, s) in body.pieces() {
            assert!((s.at(&body.nodes) - p.point).length() < 1e-15 && (s.value.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
        // Gauss's theorem: the volume from the surface's means of x.
        let solid: f64 = body.pieces().map(|(p, s)| p.area * p.normal.dot(s.at(&body.nodes)) / 3.0).sum();
        assert!((solid - 0.002).abs() < 1e-16, "{solid}");
    }
}

#[test]
fn quadratic_elements_have_fields_of_second_degree_exactly() {
    let [_, body] = bodies();
    let field: Vec<DVec3> = body.nodes.iter().map(|x| bowl(*x).0).collect();
    let off = |a: DMat3, b: DMat3| (0..3).map(|c| (a.col(c) - b.col(c)).length()).fold(0.0, f64::max);
    for (k, s) in body.points.stencils.iter().enumerate() {
        // The mean of a linear gradient is that at the centre; the mean of the field is not the field there.
        let at = s.at(&body.nodes);
        assert!(off(s.gradient_of(&field), bowl(at).1) < 1e-12);
        assert!(body.points.share(k) == Share::Mean || (s.at(&field) - bowl(at).0).length() < 1e-14);
    }
    let lookup = TetLookup::new(&body);
    for place in [DVec3::new(0.13, 0.04, 0.07), DVec3::new(0.01, 0.099, 0.001), DVec3::new(0.1, 0.05, 0.05)] {
        let (s, away) = lookup.carry(place);
        let s = s.get();
        assert!(away == 0.0 && (s.at(&field) - bowl(place).0).length() < 1e-14);
        assert!(off(s.gradient_of(&field), bowl(place).1) < 1e-12);
    }
    // Outside, the field at the nearest place goes on by its gradient.
    let (place, near) = (DVec3::new(0.23, 0.05, 0.04), DVec3::new(0.2, 0.05, 0.04));
    let (s, away) = lookup.carry(place);
    let (value, slope) = bowl(near);
    assert!((away - 0.03).abs() < 1e-15 && (s.get().at(&field) - value - slope * (place - near)).length() < 1e-14);
}

#[test]
fn linear_elements_carry_affine_fields() {
    let [body, _] = bodies();
    let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
    let x: Vec<DVec3> = body.nodes.iter().map(|x| f * *x + DVec3::Y).collect();
    let lookup = TetLookup::new(&body);
    for (place, far) in
        [(DVec3::new(0.13, 0.04, 0.07), 0.0), (DVec3::new(0.25, 0.05, 0.05), 0.05), (DVec3::splat(-0.03), 0.03 * 3f64.sqrt())]
    {
        let (s, away) = lookup.carry(place);
        assert!((s.get().at(&x) - (f * place + DVec3::Y)).length() < 1e-13 && (away - far).abs() < 1e-15, "{away}");
    }
}

#[test]
fn mass_matrices_are_exact_positive_and_have_the_shares_of_body_forces() {
    for nodes in [4, 10] {
        let rows: Vec<f64> = (0..nodes).map(|i| (0..nodes).map(|j| mass(nodes, i, j)).sum()).collect();
        for (k, row) in rows.iter().enumerate() {
            let body_force = if nodes == 4 { 0.25 } else { [-0.05, 0.2][usize::from(k > 3)] };
            assert!((row - body_force).abs() < 1e-16, "{k}: {row}");
        }
        assert!((lumped(nodes).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        // Its diagonal, scaled to the whole.
        let trace: f64 = (0..nodes).map(|i| mass(nodes, i, i)).sum();
        assert!((0..nodes).all(|i| (mass(nodes, i, i) / trace - lumped(nodes)[i]).abs() < 1e-15));
    }
    // Against a rule of high degree: Gauss–Legendre on the collapsed cube, exact to degree 7 in each direction before the weights.
    let gauss = [(0.069_431_844_202_973_71, 0.173_927_422_568_726_93), (0.330_009_478_207_571_87, 0.326_072_577_431_273_07)];
    let points: Vec<(f64, f64)> = gauss.into_iter().chain(gauss.map(|(x, w)| (1.0 - x, w))).collect();
    let mut sums = [[0.0; 10]; 10];
    for (r, a) in &points {
        for (s, b) in &points {
            for (t, c) in &points {
                let l = [*r, (1.0 - r) * s, (1.0 - r) * (1.0 - s) * t, (1.0 - r) * (1.0 - s) * (1.0 - t)];
                let weight = 6.0 * a * b * c * (1.0 - r).powi(2) * (1.0 - s);
                let n = quadratic(l);
                (0..100).for_each(|k| sums[k / 10][k % 10] += weight * n[k / 10] * n[k % 10]);
            }
        }
    }
    assert!((0..100).all(|k| (sums[k / 10][k % 10] - mass(10, k / 10, k % 10)).abs() < 1e-15));
}

#[test]
fn shares_of_the_moduli_add_up_and_derive() {
    for nu in [-0.3, 0.0, 0.3, 0.45, 0.499] {
        let lame = |nu: f64| crate::mechanics::lame::lame(1.0, nu);
        let by_nu = crate::mechanics::lame::lame_by_nu(1.0, nu);
        let [whole, local, mean] = Share::ALL.map(|s| s.of(lame(nu), by_nu));
        for k in 0..2 {
            assert!((local[k].0 + mean[k].0 - whole[k].0).abs() < 1e-12 * whole[k].0.abs().max(1.0));
            assert_eq!(local[k].1 + mean[k].1, whole[k].1);
        }
        let d = 1e-6;
        for (share, now) in Share::ALL.into_iter().zip([whole, local, mean]) {
            let [a, b] = [nu + d, nu - d].map(|n| share.of(lame(n), by_nu)[0]);
            let size = now[1].0.abs().max(1.0);
            assert!(((a.0 - b.0) / (2.0 * d) - now[1].0).abs() < 1e-5 * size, "{share:?} at {nu}");
            assert!(((a.1 - b.1) / (2.0 * d) - now[1].1).abs() < 1e-6);
        }
        assert!(local[0].0 < crate::space::points::LOCAL * local[0].1);
    }
}
