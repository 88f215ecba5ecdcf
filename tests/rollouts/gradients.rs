//! Adjoint = sensitivities = central differences, for every parameter, on a small scene with everything active: contact on two
//! planes, cut cells, damping, a clamp that moves, a point mass, depth points, markers and displacements in frames that lie
//! between steps.

use glam::{DQuat, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, ResidualRow, Rollout, Wanted};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::observation::{
    Camera, Channel, Frame, MarkerRest, Observation, ObservedDisplacement, ObservedMarker, ObservedPoint, ReadingKind,
};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use support::{scenes, tets};

pub(super) fn ball() -> Scene {
    let mut s = scenes::body(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, -0.002, 0.06) }, 0.022);
    s.material.mass_damping = 0.3;
    s.material.stiffness_damping = 0.004;
    s.gravity = DVec3::new(0.4, -0.3, -9.0);
    s.planes = vec![
        scenes::plane(DVec3::ZERO, DVec3::new(0.1, 0.05, 1.0)),
        scenes::plane(DVec3::new(-0.045, 0.0, 0.0), DVec3::new(1.0, 0.2, 0.1)),
    ];
    s.masses = vec![PointMass { point: DVec3::new(0.0, 0.02, 0.09), mass: 0.02 }];
    s.initial.velocity = DVec3::new(-0.3, 0.1, -0.8);
    s.initial.angular_velocity = DVec3::new(2.0, -5.0, 1.0);
    s.time = Time { step: 0.01, steps: 6, start: 0.002, ..Time::weighted(0.6) };
    s.solver.tolerance = 1e-13;
    s
}

/// Points on the surface of the body as it is after some steps of other parameters, so that no residual is zero.
pub(super) fn observed(scene: &Scene, times: &[f64]) -> Plan {
    let marker =
        MarkerRest { name: "m".into(), position: DVec3::new(0.0, 0.01, 0.118), surface: Some(DVec3::new(0.0, 0.005, 0.11)) };
    let plain = build_plan(scene, Observation::default(), &[]).unwrap();
    let mut theta = plain.theta.clone();
    theta[0] *= 1.15;
    let mut states = Vec::new();
    Rollout::new(CpuBackend, &plain, 1)
        .unwrap()
        .visit(&theta, |_, s, _| {
            states.push(s);
            std::ops::ControlFlow::Continue(())
        })
        .unwrap();
    let body = &plain.body;
    // One on each side: every point is seen by the camera nearest to it.
    let sides = DVec3::AXES.into_iter().flat_map(|a| [a, -a]);
    let cameras: Vec<Camera> = sides.map(|a| Camera::Pinhole { center: DVec3::new(0.0, 0.0, 0.05) + a, axis: -a }).collect();
    let frames = times
        .iter()
        .map(|&time| {
            let k = (((time - scene.time.start) / scene.time.step).round().max(0.0) as usize).min(states.len() - 1);
            let u = &states[k].displacement;
            let points = body
                .pieces()
                .map(|(p, place)| {
                    let moved = place.at(u);
                    // A little off the surface, in and out.
                    let off = 0.002 * (1.0 + 40.0 * p.point.x).sin();
                    let position = p.point + moved + off * p.normal;
                    let away = |c: &u32| cameras[*c as usize].center().map_or(f64::INFINITY, |p| p.distance(position));
                    let camera = (0..6).min_by(|a, b| away(a).total_cmp(&away(b))).expect("there are six");
                    ObservedPoint { position, camera }
                })
                .collect();
            Frame {
                time,
                points,
                markers: vec![ObservedMarker { site: 0, position: DVec3::new(0.001, 0.012, 0.11) }],
                displacements: ObservedDisplacement::of_all(u.iter().map(|u| *u + DVec3::new(1e-4, -2e-4, 3e-4))),
                ..Frame::default()
            }
        })
        .collect();
    let observation = Observation {
        cameras,
        frames,
        channels: vec![
            Channel::new(ReadingKind::Depth, 1e-3),
            Channel::new(ReadingKind::Marker, 2e-3),
            Channel::new(ReadingKind::Displacement, 5e-3),
        ],
        ..Observation::default()
    };
    let plan = build_plan(scene, observation, &[marker]).unwrap();
    away_from_kinks(plan)
}

/// Without the points that differences may take across a face of the distance's samples, where its slope jumps: differences over a kink are
/// no derivatives.
pub(super) fn away_from_kinks(plan: Plan) -> Plan {
    let body = &plan.body;
    let rows = Rollout::new(CpuBackend, &plan, 1).unwrap().linearise(&plan.theta, &[0]).unwrap().rows.residuals;
    let far = |rest: DVec3| {
        let place = (rest - body.band.grid.position([0; 3])) * (SUBDIVISIONS as f64 / body.length);
        (place - place.round()).abs().min_element() > 0.02
    };
    let mut observation = (*plan.observation).clone();
    for (k, f) in observation.frames.iter_mut().enumerate() {
        let kept = |r: &&ResidualRow| r.frame == k && r.value.is_some() && far(r.rest);
        let numbers = rows.iter().filter(kept).filter(|r| r.source.is_depth()).map(|r| r.source.item as usize);
        let points: Vec<ObservedPoint> = numbers.map(|n| f.points[n]).collect();
        assert!(2 * points.len() > f.points.len(), "{} of {} points are left", points.len(), f.points.len());
        f.points = points;
    }
    Plan { observation: observation.into(), ..plan }
}

fn evaluate(rollout: &mut Rollout<CpuBackend>, theta: &[f64], request: &Request) -> Evaluation {
    let e = rollout.evaluate(&ParamBatch::from_rows(&[theta.to_vec()]), request).remove(0);
    if let Some(f) = &e.failure {
        panic!("{f}");
    }
    e
}

/// Compares all three derivatives of every parameter.
fn check(plan: &Plan, name: &str) {
    // Of planes that nothing touches all derivatives agree: on zero.
    let touched = check_some(plan, name, |_| true);
    let wanted = if plan.initial == InitialShape::Rest { 2 } else { 1 };
    assert!(touched >= wanted, "{name}: contact with {touched} planes");
}

/// Compares adjoint and sensitivities of every parameter, and both with differences for some; the number of planes whose height matters.
pub(super) fn check_some(plan: &Plan, name: &str, some: impl Fn(ParamKey) -> bool) -> usize {
    let p = plan.layout.len();
    let chosen: Vec<usize> = (0..p).filter(|i| some(plan.layout.keys[*i])).collect();
    let mut rollout = Rollout::new(CpuBackend, plan, 2 * p).unwrap();
    let adjoint = evaluate(&mut rollout, &plan.theta, &Request { gradient: Wanted::All, sensitivities: Vec::new() });
    let all: Vec<usize> = (0..p).collect();
    let forward = evaluate(&mut rollout, &plan.theta, &Request { gradient: Wanted::Nothing, sensitivities: all.clone() });
    let forward = forward.curvature.unwrap().gradient;
    assert!(adjoint.matched > 0, "{name}: something is compared");
    // Differences are of fourth order, over 1e-4 of a size that matters. No frame lies on a step boundary: there the curve through
    // the states has a kink in its second derivative.
    let size = |i: usize| {
        let spec = plan.layout.keys[i].spec();
        match spec.transform {
            _ if matches!(spec.key, ParamKey::Effect { .. }) => spec.typical,
            palpate_model::params::Transform::Linear => spec.typical.min(1.0),
            _ => plan.theta[i],
        }
    };
    let largest = (0..p).map(|i| (adjoint.gradient[i] * size(i)).abs()).fold(0.0, f64::max);
    let rows: Vec<Vec<f64>> = chosen
        .iter()
        .flat_map(|&i| {
            [-2.0, -1.0, 1.0, 2.0].map(|s| {
                let mut t = plan.theta.clone();
                t[i] += s * 1e-4 * size(i);
                t
            })
        })
        .collect();
    let costs: Vec<f64> = rollout.evaluate(&ParamBatch::from_rows(&rows), &Request::default()).iter().map(|e| e.cost).collect();
    let mut worst = (0.0f64, 0.0f64);
    for i in 0..p {
        let (a, f) = (adjoint.gradient[i] * size(i), forward[i] * size(i));
        let difference = chosen.iter().position(|c| *c == i).map_or(a, |k| {
            let c = &costs[4 * k..4 * k + 4];
            (c[0] - 8.0 * c[1] + 8.0 * c[2] - c[3]) / (12.0 * 1e-4)
        });
        println!(
            "{name} {:32} adjoint {a:+.10e} forward {f:+.10e} differences {difference:+.10e}",
            plan.layout.keys[i].spec().path
        );
        // Relative to the parameter's own derivative, or to a thousandth of the largest for those that hardly matter.
        let scale = a.abs().max(1e-3 * largest);
        worst = (worst.0.max((a - f).abs() / scale), worst.1.max((a - difference).abs() / scale));
    }
    println!("{name}: adjoint - forward {:.1e}, adjoint - differences {:.1e}", worst.0, worst.1);
    assert!(worst.0 < 1e-9, "{name}: adjoint and sensitivities differ by {:.1e}", worst.0);
    assert!(worst.1 < 1e-6, "{name}: adjoint and differences differ by {:.1e}", worst.1);
    let height = |i: &usize| matches!(plan.layout.keys[*i], ParamKey::PlaneHeight(_));
    (0..p).filter(height).filter(|&i| (adjoint.gradient[i] * size(i)).abs() > 1e-6 * largest).count()
}

#[test]
fn bouncing_ball() {
    check(&observed(&ball(), &[0.025, 0.0437, 0.06]), "ball");
}

/// The same as a box of quadratic tetrahedra: depth points are looked up in the lattice that follows its nodes.
#[test]
fn depth_points_on_tetrahedra() {
    let mut s = ball();
    let source = tets::bar(DVec3::new(-0.047, -0.05, 0.01), 0.05, [2, 2, 2]);
    s.object = Object { source, pose: glam::DAffine3::from_rotation_x(0.1), resolution: Resolution::Own };
    // Its derivatives have formulas: several times as fast as the linear one.
    s.material.model = palpate_model::materials::find("neo-hookean").expect("it is in the table");
    s.time.steps = 4;
    let plan = observed(&s, &[0.025, 0.0437]);
    let some =
        |key| matches!(key, ParamKey::YoungsModulus | ParamKey::Gravity(2) | ParamKey::Velocity(0) | ParamKey::PlaneHeight(0));
    assert_eq!(check_some(&plan, "box of tetrahedra", some), 2, "contact");
}

#[test]
fn bouncing_ball_that_touches_along_the_way_of_each_step() {
    let mut s = ball();
    s.time.theta = 0.55;
    check(&observed(&s, &[0.025, 0.0437, 0.06]), "along the way");
}

#[test]
fn each_cost_by_itself() {
    let plan = observed(&ball(), &[0.025, 0.0437, 0.06]);
    for (kept, name) in ["points", "markers", "displacements"].into_iter().enumerate() {
        let mut observation = (*plan.observation).clone();
        for f in &mut observation.frames {
            f.points.retain(|_| kept == 0);
            f.markers.retain(|_| kept == 1);
            f.displacements.retain(|_| kept == 2);
        }
        check(&Plan { observation: observation.into(), ..plan.clone() }, name);
    }
}

#[test]
fn bouncing_ball_of_other_elements() {
    for element in [Element::Corner, Element::Trilinear] {
        let mut s = ball();
        s.solver.element = element;
        check(&observed(&s, &[0.025, 0.0437, 0.06]), &format!("{element:?}"));
    }
}

#[test]
fn static_equilibrium_then_motion() {
    let mut s = ball();
    s.initial.state = InitialShape::StaticEquilibrium;
    s.initial.velocity = DVec3::ZERO;
    let motion = RigidMotion {
        times: vec![0.0, 0.03, 0.06, 0.09],
        translations: vec![DVec3::ZERO, DVec3::new(0.004, 0.0, 0.002), DVec3::new(0.003, -0.004, 0.0), DVec3::ZERO],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_x(0.1), DQuat::from_rotation_x(0.15), DQuat::from_rotation_y(0.1)],
    };
    s.clamps = vec![Clamp { motion: Some(motion), ..Clamp::still(DVec3::new(-0.1, 0.03, 0.0), DVec3::new(0.1, 0.1, 0.2)) }];
    check(&observed(&s, &[0.0, 0.03, 0.055]), "static start");
}

#[test]
fn static_problem() {
    let mut s = ball();
    s.initial =
        Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state: InitialShape::StaticEquilibrium };
    s.time.steps = 0;
    s.clamps = vec![Clamp::still(DVec3::new(-0.1, 0.03, 0.0), DVec3::new(0.1, 0.1, 0.2))];
    check(&observed(&s, &[0.0]), "static");
}
