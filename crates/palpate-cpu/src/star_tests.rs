//! Bodies of points as a whole: derivatives of a rollout against differences, and what a body of points and its clamp do.

use crate::CpuBackend;
use crate::local_bodies::{Made, cloud};
use glam::DVec3;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::Effect;
use palpate_model::materials;
use palpate_model::observation::{Channel, Frame, Observation, ObservedMarker, ReadingKind, TrackRest};
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{BodySource, Scene, Solver};

/// Tracks of three places, two of them between points, moved somewhere.
fn tracks(times: &[f64]) -> Observation {
    let rest = vec![DVec3::new(0.0, 0.0, 0.03), DVec3::new(-0.03, 0.03, 0.01), DVec3::new(0.03, -0.02, 0.05)];
    let markers = |t: f64| {
        let moved = |p: &DVec3| *p + DVec3::new(0.02 * t, 0.01, -0.3 * t) * p.z;
        (0..).zip(&rest).map(|(site, p)| ObservedMarker { site, position: moved(p) }).collect()
    };
    Observation {
        frames: times.iter().map(|t| Frame { time: *t, markers: markers(*t), ..Frame::default() }).collect(),
        channels: vec![Channel::new(ReadingKind::Track, 1e-3)],
        tracks: TrackRest { places: rest.clone(), tolerance: None },
        ..Observation::default()
    }
}

/// A clamped cloud that moves, touches a plane, and has a stiffness for every point.
fn scene() -> Scene {
    let values = Some((0..27).map(|k| 1.0 + 0.3 * (1.7 * k as f64).sin()).collect());
    let field = FieldSpec { varied: Varied::Modulus, basis: Basis::Points, scale: Scale::Log, values, prior: None };
    let mut s = Made { fields: vec![field], ..Made::of(cloud(3), Vec::<Effect>::new()) }.scene();
    s.material.model = materials::find("neo-hookean").expect("it is in the table");
    s.solver = Solver { tolerance: 1e-12, ..Solver::default() };
    s
}

fn planned(scene: &Scene) -> Plan {
    build_plan(scene, tracks(&[0.06, 0.075]), &[]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_adjoint_of_a_body_of_points_is_its_difference() {
    let plan = planned(&scene());
    let mut rollout = Rollout::new(CpuBackend, &plan, 2).unwrap();
    let field: Vec<usize> = plan.layout.resolve("field.0").step_by(5).collect();
    let keys = [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density, ParamKey::Gravity(2), ParamKey::PointMass(0)];
    let places: Vec<usize> = keys.iter().map(|k| plan.layout.index(*k)).chain(field).collect();
    let request = Request { gradient: Wanted::All, sensitivities: places.clone() };
    let found = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    assert!(found.failure.is_none(), "{:?}", found.failure);
    let forward = found.curvature.unwrap().gradient;
    for (k, p) in places.iter().enumerate() {
        // Fourth order with steps of a thousandth: solves to 1e-12 leave eight digits.
        let step = 1e-3 * plan.theta[*p].abs();
        let cost = |by: f64, rollout: &mut Rollout<CpuBackend>| {
            let mut theta = plan.theta.clone();
            theta[*p] += by * step;
            rollout.evaluate(&ParamBatch::of(&theta), &Request::default()).remove(0).cost
        };
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|by| cost(by, &mut rollout));
        let difference = (a - 8.0 * b + 8.0 * c - d) / (12.0 * step);
        let adjoint = found.gradient[*p];
        assert!((adjoint - difference).abs() < 1e-6 * adjoint.abs(), "{:?}: {adjoint} {difference}", plan.layout.keys[*p]);
        assert!((adjoint - forward[k]).abs() < 1e-8 * adjoint.abs(), "{:?}: {adjoint} {}", plan.layout.keys[*p], forward[k]);
    }
}

/// Mass and weight are those of the volume, and the penalty is there.
#[test]
fn a_cloud_has_its_weight_and_its_penalty() {
    let mut s = scene();
    let plan = planned(&s);
    assert!((plan.body.node_volume.iter().sum::<f64>() / 1e-3 - 1.0).abs() < 1e-9);
    let cost = |plan: &Plan| {
        let mut rollout = Rollout::new(CpuBackend, plan, 1).unwrap();
        rollout.evaluate(&ParamBatch::of(&plan.theta), &Request::default()).remove(0).cost
    };
    let with = cost(&plan);
    if let BodySource::Cloud(c) = &mut s.object.source {
        c.stars.residual_penalty = 0.0;
    }
    let without = cost(&planned(&s));
    assert!((with / without - 1.0).abs() > 1e-3, "{with} {without}");
}
