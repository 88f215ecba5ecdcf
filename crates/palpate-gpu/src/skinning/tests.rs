//! Places that follow bodies, on the device and by their stencils.

use super::{Skinning, TOGETHER};
use crate::tests::scenes::{ball, device, plan};
use glam::{DMat3, DQuat, DVec3};
use palpate_model::space::stencil::Stencils;

/// A place in every part of a box around the body, in it and beside it.
fn places(low: DVec3, high: DVec3, each: usize) -> Vec<DVec3> {
    let at = |n: usize| DVec3::new((n % each) as f64, (n / each % each) as f64, (n / each / each) as f64) / (each - 1) as f64;
    (0..each.pow(3)).map(|n| low + (high - low) * at(n)).collect()
}

#[test]
fn places_go_where_their_stencils_say() {
    let Some(gpu) = device(None) else { return };
    let body = plan(&ball(0.01)).body;
    let (low, high) = body.nodes.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let rest = places(low, high, 9);
    let followers = body.followers(&rest);
    let mut skinning = Skinning::on(gpu, &followers.stencils, body.nodes.len()).unwrap_or_else(|e| panic!("{e}"));
    let (size, middle) = (high - low, 0.5 * (low + high));
    // Turned and far away, bent, and stretched.
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 2.1);
    let far = DVec3::new(3.0, -2.0, 5.0);
    let turned = |x: DVec3| turn * (x - middle) + middle + far;
    let bent = |x: DVec3| x + DVec3::new(0.3 * x.z * x.z / size.z, -0.2 * x.x, 0.1 * x.y);
    let motions: [&dyn Fn(DVec3) -> DVec3; 2] = [&turned, &bent];
    for (k, motion) in motions.into_iter().enumerate() {
        let u: Vec<DVec3> = body.nodes.iter().map(|x| motion(*x) - *x).collect();
        let found = skinning.moved(&u).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(found.len(), rest.len());
        for ((place, s), (moved, h)) in rest.iter().zip(followers.stencils.iter()).zip(&found) {
            // Displacements are a few bodies long at most; each is a rounding of 6e-8 off, and a stencil sums some fifty. What a gradient makes of
            // that is told over an element, of which the body has ten.
            assert!((*moved - s.at(&u)).length() < 1e-6 * size.max_element(), "{place}: {moved} {}", s.at(&u));
            let off = (0..3).map(|c| (h.col(c) - s.gradient_of(&u).col(c)).length()).fold(0.0, f64::max);
            assert!(off < 1e-5, "{place}: {off}");
            if k == 0 {
                // A rigid motion carries everything exactly.
                assert!((*place + *moved - turned(*place)).length() < 1e-6 * size.max_element());
                let exact = DMat3::from_quat(turn) - DMat3::IDENTITY;
                assert!((0..3).all(|c| (h.col(c) - exact.col(c)).length() < 1e-5));
            }
        }
        // The same bits every time.
        assert_eq!(skinning.moved(&u).unwrap_or_else(|e| panic!("{e}")), found);
    }
}

#[test]
fn more_places_than_a_dispatch_has_take_turns() {
    let Some(gpu) = device(None) else { return };
    let count = TOGETHER + 77;
    let mut stencils = Stencils::default();
    for n in 0..count {
        stencils.push_with_gradient(&[(n % 5) as u32], &[1.0], &[DVec3::X]);
    }
    let u: Vec<DVec3> = (0..5).map(|n| DVec3::splat(n as f64)).collect();
    let mut skinning = Skinning::on(gpu, &stencils, u.len()).unwrap_or_else(|e| panic!("{e}"));
    let found = skinning.moved(&u).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(found.len(), count);
    // A gradient of one node alone sees nothing.
    assert!(found.iter().enumerate().all(|(n, (moved, h))| *moved == u[n % 5] && *h == DMat3::ZERO));
}
