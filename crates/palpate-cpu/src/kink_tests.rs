//! Damping that does not depend on frequency has a kink where a strain turns round. Newton's exact tangent sees no curvature beside it and hops to
//! its other side; with the majorised tangent in turn a step ends within a few iterations.

use crate::collapse_tests;
use crate::linear::matrix::{Matrix, Operator, Packed};
use crate::linear::vector::dot;
use crate::local_bodies::tetrahedra;
use crate::local_tests::world;
use crate::simulate;
use crate::terms::{Curvature, zeros};
use crate::world::{MemberState, World};
use glam::DVec3;
use palpate_model::effects::{Effect, find};
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;

/// A bar that is held at its end and swings under loads from two sides, so damped that they hold it for a while: of cells, or a block of tetrahedra.
fn bar(tets: bool) -> Scene {
    let mut s = collapse_tests::scene(4e5);
    s.planes.clear();
    let (min, max) = (DVec3::new(0.0, -0.015, 0.1), DVec3::new(0.2, 0.015, 0.13));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    s.object.resolution = Resolution::CellSize(0.015);
    let mut clamp = Clamp::still(DVec3::new(-0.01, -0.03, 0.08), DVec3::new(0.025, 0.03, 0.15));
    if tets {
        s.object.source = tetrahedra(3);
        clamp = Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(-0.02, 0.1, 0.2));
        s.material.youngs_modulus = 2e4;
    }
    s.clamps = vec![clamp];
    s.gravity = DVec3::new(0.0, 3.84, -8.85);
    s.time = Time { step: 0.01, steps: 32, start: 0.0, ..Time::weighted(0.6) };
    let mut damping = Effect::absent(find("structural-damping").unwrap());
    damping.values[0] = Some(1.0);
    s.effects = vec![damping];
    s
}

fn plan(tets: bool) -> Plan {
    build_plan(&bar(tets), Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_bar_that_loses_all_in_a_swing_takes_few_iterations() {
    for tets in [true, false] {
        let plan = plan(tets);
        let ran = collapse_tests::run(&plan);
        let steps = plan.clock.steps;
        println!("tetrahedra {tets}: {} iterations in {steps} steps", ran.effort.newton);
        assert!(ran.failure.is_none(), "{} of {steps} steps: {:?}", ran.solved, ran.failure);
        // The exact tangent alone takes 30 in many steps, and more than 60 in one, which ends the bar's motion.
        assert!(ran.effort.newton < 8 * steps, "{} iterations in {steps} steps", ran.effort.newton);
    }
}

#[test]
fn the_majorised_tangent_lies_above_the_exact_one_and_is_it_without_dissipation() {
    for (tets, lossy) in [(false, true), (true, true), (false, false), (true, false)] {
        let mut plan = plan(tets);
        if !lossy {
            plan.theta[plan.layout.keys.iter().position(|k| k.spec().path.ends_with("loss")).unwrap()] = 0.0;
        }
        let World { shared, members } = &world(&plan, &plan.theta);
        let member = &members[0];
        let n = plan.body.nodes.len();
        // What clamps hold is too stiff to see the rest beside it.
        let middle = plan.body.nodes.iter().map(|x| x.x).sum::<f64>() / n as f64;
        let wave = |k: f64| -> Vec<DVec3> {
            plan.body
                .nodes
                .iter()
                .map(|x| 1e-3 * DVec3::from_array((k * 50.0 * (*x + DVec3::ONE)).to_array().map(f64::sin)))
                .collect()
        };
        let (old, u) = (MemberState { u: wave(1.0), v: zeros(n) }, wave(1.3));
        let stage = &plan.clock.stages()[0];
        let start = simulate::Start::new(stage, &[&old]);
        let mut e = simulate::equation(shared, member, Some(stage), &start);
        e.residual(&u);
        let [exact, above] = [Curvature::Exact, Curvature::Majorised].map(|c| {
            let mut m = Matrix::default();
            e.tangent(&u, c, &mut m);
            m
        });
        let forms: Vec<[f64; 2]> = (0..8)
            .map(|k| {
                let mut x = wave(2.0 + 0.7 * k as f64);
                x.iter_mut().zip(&plan.body.nodes).filter(|(_, place)| place.x < middle).for_each(|(x, _)| *x = DVec3::ZERO);
                [&exact, &above].map(|m| {
                    let mut y = zeros(n);
                    Packed::new(&shared.pattern.blocks, m, |v| v).multiply(&x, &mut y);
                    dot(&x, &y)
                })
            })
            .collect();
        println!("tetrahedra {tets}, lossy {lossy}: {forms:?}");
        if lossy {
            assert!(forms.iter().all(|[exact, above]| *above >= *exact), "{forms:?}");
            assert!(forms.iter().any(|[exact, above]| *above > 1.01 * *exact), "{forms:?}");
        } else {
            assert_eq!(exact.values, above.values);
        }
    }
}
