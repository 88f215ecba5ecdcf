//! Sequences of equilibria under loads and attachments from files: their derivatives, and what they are equal to.

use super::gradients::check_some;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Failure, FailureKind, Rollout, Snapshot};
use palpate_model::effects::driven::{Drive, Points};
use palpate_model::effects::{Effect, find};
use palpate_model::mechanics::series::Series;
use palpate_model::observation::{Channel, Frame, Observation, ObservedMarker, ReadingKind, TrackRest};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::QUASI_STATIC;
use palpate_model::scene::*;
use std::ops::ControlFlow;
use std::sync::Arc;
use support::scenes;

const TIP: [DVec3; 2] = [DVec3::new(0.1, 0.004, 0.03), DVec3::new(0.1, 0.026, 0.03)];
const MIDDLE: [DVec3; 2] = [DVec3::new(0.05, 0.002, 0.002), DVec3::new(0.055, 0.028, 0.028)];

/// A beam of 250 kPa that is held at x = 0, without a load.
pub(super) fn beam() -> Scene {
    let mut s = scenes::body(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.1, 0.03, 0.03) }, 0.0125);
    s.material = Material::undamped(2.5e5, 0.45);
    s.gravity = DVec3::new(0.0, 0.4, -9.81);
    s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.006, 1.0, 1.0))];
    s.time = Time { scheme: &QUASI_STATIC, steps: 0, ..Time::default() };
    s.solver.tolerance = 1e-12;
    s
}

fn driven(kind: &str, values: &[f64], points: Points, times: &[f64], vectors: Vec<DVec3>) -> Effect {
    let series = Series { count: points.len(), times: times.to_vec(), vectors };
    let drive = Drive { points, series: Arc::new(series), tracked: Vec::new() };
    Effect {
        values: values.iter().copied().map(Some).collect(),
        drive: Some(Arc::new(drive)),
        ..Effect::absent(find(kind).expect("it is in the table"))
    }
}

fn places(all: &[DVec3]) -> Points {
    Points::Places(all.to_vec(), None)
}

/// A load on the tip that grows and turns.
fn load(times: &[f64]) -> Effect {
    let force = |t: f64| DVec3::new(0.1 * t, 0.15 * t * t, -0.3 * t);
    let vectors = times.iter().flat_map(|t| [force(*t), 0.7 * force(*t)]).collect();
    driven("file-load", &[1.2], places(&TIP), times, vectors)
}

/// Soft springs that draw the middle aside; the second point is not seen at the second time.
fn strings(times: &[f64], stiffness: f64) -> Effect {
    let at = |k: usize, t: f64| MIDDLE[k] + DVec3::new(0.0, 0.004 * t, 0.002 * t);
    let mut vectors: Vec<DVec3> = times.iter().flat_map(|t| [at(0, *t), at(1, *t)]).collect();
    if times.len() > 1 {
        vectors[3] = DVec3::NAN;
    }
    driven("attachment", &[stiffness, 1e-4, -2e-4, 3e-4], places(&MIDDLE), times, vectors)
}

/// What tracks of three points of the beam would be, at times [s].
pub(super) fn tracks(times: &[f64]) -> Observation {
    let rest = vec![DVec3::new(0.1, 0.015, 0.015), DVec3::new(0.07, 0.0, 0.03), DVec3::new(0.04, 0.03, 0.0)];
    let moved = |p: &DVec3, t: f64| *p + p.x * p.x * DVec3::new(-0.1 * t, 0.2 * t, -1.1 * t);
    let markers = |t: f64| (0..).zip(&rest).map(|(site, p)| ObservedMarker { site, position: moved(p, t) }).collect();
    Observation {
        frames: times.iter().map(|t| Frame { time: *t, markers: markers(*t), ..Frame::default() }).collect(),
        channels: vec![Channel::new(ReadingKind::Track, 3e-4)],
        tracks: TrackRest { places: rest.clone(), tolerance: None },
        ..Observation::default()
    }
}

pub(super) fn planned(scene: &Scene, observation: Observation) -> Plan {
    build_plan(scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

fn states(plan: &Plan) -> Result<Vec<Snapshot>, Failure> {
    let mut all = Vec::new();
    Rollout::new(CpuBackend, plan, 1).expect("the CPU takes it").visit(&plan.theta, |_, s, _| {
        all.push(s);
        ControlFlow::Continue(())
    })?;
    Ok(all)
}

/// Largest difference of two displacements over the size of the first.
fn apart(a: &Snapshot, b: &Snapshot) -> f64 {
    let size = a.displacement.iter().map(|u| u.length()).fold(0.0, f64::max);
    a.displacement.iter().zip(&b.displacement).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) / size
}

/// Irregular times, neither of which is a multiple of another.
const TIMES: [f64; 3] = [0.3, 1.0, 1.7];

#[test]
fn derivatives_of_a_sequence_are_exact() {
    let mut s = beam();
    s.planes = vec![scenes::plane(DVec3::new(0.0, 0.0, -0.004), DVec3::new(-0.05, 0.02, 1.0))];
    s.effects = vec![load(&TIMES), strings(&TIMES, 60.0)];
    let plan = planned(&s, tracks(&TIMES));
    assert_eq!((plan.times.as_slice(), plan.clock.steps), (&TIMES[..], 2));
    // Velocity, damping and the start of the clock have no part in it.
    let some = |key| {
        !matches!(
            key,
            ParamKey::Velocity(_)
                | ParamKey::AngularVelocity(_)
                | ParamKey::MassDamping
                | ParamKey::StiffnessDamping
                | ParamKey::TimeStart
        )
    };
    assert_eq!(check_some(&plan, "sequence", some), 1, "it touches the plane");
}

#[test]
fn a_state_is_what_its_loads_make_it_whatever_came_before() {
    let mut s = beam();
    s.effects = vec![load(&TIMES), strings(&TIMES, 60.0)];
    let all = states(&planned(&s, tracks(&TIMES))).unwrap();
    assert_eq!(all.iter().map(|s| s.time).collect::<Vec<_>>(), TIMES.map(|t| t - TIMES[0]));
    for (k, time) in TIMES.iter().enumerate() {
        let alone = states(&planned(&s, tracks(&[*time]))).unwrap();
        // Both end within the solver's tolerance, 1e-12 of the forces, of the same state; a beam's condition costs some digits.
        assert!(alone.len() == 1 && apart(&all[k], &alone[0]) < 1e-8, "{k}: {}", apart(&all[k], &alone[0]));
    }
    assert!(apart(&all[0], &all[2]) > 0.1, "the loads change the state");
}

#[test]
fn a_state_is_where_a_damped_motion_comes_to_rest() {
    let mut s = beam();
    s.effects = vec![load(&TIMES)];
    let still = states(&planned(&s, tracks(&TIMES))).unwrap();
    // The same load for ever, and a body that hardly swings: steps of a backward scheme take the rest within some seconds.
    for (k, time) in TIMES.iter().enumerate() {
        let force = |f: f64| f * DVec3::new(0.1 * time, 0.15 * time * time, -0.3 * time);
        s.effects = vec![driven("file-load", &[1.2], places(&TIP), &[0.0], vec![force(1.0), force(0.7)])];
        s.material.mass_damping = 40.0;
        s.time = Time { step: 0.05, steps: 120, ..Time::default() };
        let motion = states(&planned(&s, Observation::default())).unwrap();
        let left = apart(&still[k], &motion[120]);
        // The slowest mode decays by e⁻²⁰ⁿ in n seconds at the least; what is left are the tolerances of both solves.
        assert!(left < 1e-7, "{k}: {left}");
        assert!(apart(&still[k], &motion[3]) > 1e-3, "{k}: it moves");
    }
}

/// Forces on all nodes that are those of the effect "uniform-force".
fn uniform(body: &palpate_model::space::body::Body, per_volume: DVec3) -> Effect {
    let nodes = (0..body.nodes.len() as u32).collect();
    let vectors = body.node_volume.iter().map(|v| *v * per_volume).collect();
    driven("file-load", &[1.0], Points::Nodes(nodes), &[0.0], vectors)
}

#[test]
fn a_load_in_a_file_is_the_same_load_as_an_effect() {
    let force = DVec3::new(500.0, 1000.0, -2000.0);
    let mut s = beam();
    let body = planned(&s, Observation::default()).body;
    let mut effect = Effect::absent(find("uniform-force").unwrap());
    effect.values.iter_mut().zip(force.to_array()).for_each(|(v, f)| *v = Some(f));
    let clocks =
        [s.time, Time { step: 0.004, steps: 15, ..Time::weighted(0.55) }, Time { step: 0.004, steps: 15, ..Time::default() }];
    for time in clocks {
        s.time = time;
        let mut of = |e: &Effect| {
            s.effects = vec![e.clone()];
            states(&planned(&s, Observation::default())).unwrap().pop().unwrap()
        };
        let (file, other) = (of(&uniform(&body, force)), of(&effect));
        // Shares of nodes are summed in another order: the rounding of forces, through the solver's tolerance.
        assert!(apart(&file, &other) < 1e-9, "{}: {}", time.scheme.name, apart(&file, &other));
    }
}

#[test]
fn forces_between_rows_are_linear_in_time() {
    let mut s = beam();
    s.clamps.clear();
    s.gravity = DVec3::ZERO;
    let free = planned(&Scene { time: Time::weighted(0.5), ..s.clone() }, Observation::default());
    let [a, b] = [DVec3::new(0.0, 0.0, 0.02), DVec3::new(0.03, 0.0, -0.01)];
    let of = |f: DVec3| uniform(&free.body, f / free.body.volume).drive.unwrap().series.vectors.clone();
    let nodes = Points::Nodes((0..free.body.nodes.len() as u32).collect());
    // Held before the first row, then linear, then held again: 0.02 s, 0.06 s and 0.02 s in whole steps.
    s.effects = vec![driven("file-load", &[1.0], nodes, &[0.02, 0.08], [of(a), of(b)].concat())];
    s.time = Time { step: 0.005, steps: 20, ..Time::weighted(0.5) };
    let plan = planned(&s, Observation::default());
    let end = states(&plan).unwrap().pop().unwrap();
    let mass = |i: usize| 1000.0 * plan.body.node_volume[i];
    let momentum: DVec3 = end.velocity.iter().enumerate().map(|(i, v)| mass(i) * *v).sum();
    let wanted = 0.02 * a + 0.06 * 0.5 * (a + b) + 0.02 * b;
    // The trapezoidal rule sums a linear force exactly; the solver leaves 1e-12 of the forces in each of 20 steps.
    assert!((momentum - wanted).length() < 1e-9 * wanted.length(), "{momentum} {wanted}");
}

#[test]
fn attached_points_carry_the_body() {
    let mut s = beam();
    s.clamps.clear();
    let hung = [DVec3::new(0.01, 0.015, 0.03), DVec3::new(0.09, 0.003, 0.03), DVec3::new(0.09, 0.027, 0.03)];
    let stiffness = 30.0;
    s.effects = vec![driven("attachment", &[stiffness, 0.0, 0.0, 0.0], places(&hung), &[0.0], hung.to_vec())];
    let plan = planned(&s, Observation::default());
    let state = states(&plan).unwrap().remove(0);
    let sites = plan.driven[0].as_ref().unwrap();
    let pull: DVec3 = sites.stencils.iter().map(|p| -stiffness * p.at(&state.displacement)).sum();
    let weight = 1000.0 * plan.body.node_volume.iter().sum::<f64>() * s.gravity;
    // Forces balance as closely as they are solved.
    assert!((pull + weight).length() < 1e-9 * weight.length(), "{pull} {weight}");
    // On a line they leave a turn free, and without any the body is nowhere.
    for (points, said) in
        [(vec![hung[0], hung[1]], "attach.0.points: of the 2 attached points"), (vec![], "time.mode: = \"quasi-static\" needs")]
    {
        s.effects.truncate(usize::from(!points.is_empty()));
        s.effects
            .iter_mut()
            .for_each(|e| *e = driven("attachment", &[3.0, 0.0, 0.0, 0.0], places(&points), &[0.0], points.clone()));
        let refused = build_plan(&s, Observation::default(), &[]).unwrap_err().to_string();
        assert!(refused.contains(said), "{refused}");
    }
}

#[test]
fn a_point_that_is_not_seen_is_not_held() {
    let mut s = beam();
    let with = |s: &mut Scene, effects: Vec<Effect>, times: &[f64]| {
        s.effects = effects;
        states(&planned(s, tracks(times))).unwrap()
    };
    let all = with(&mut s, vec![strings(&TIMES, 60.0)], &TIMES);
    // The second point of the second time is NaN.
    let first = |t: f64| MIDDLE[0] + DVec3::new(0.0, 0.004 * t, 0.002 * t);
    let lone = driven("attachment", &[60.0, 1e-4, -2e-4, 3e-4], places(&MIDDLE[..1]), &[0.0], vec![first(TIMES[1])]);
    let alone = with(&mut s, vec![lone], &[TIMES[1]]);
    assert!(apart(&all[1], &alone[0]) < 1e-8, "{}", apart(&all[1], &alone[0]));
}

#[test]
fn a_state_that_would_not_stay_fails_by_its_number() {
    let mut s = beam();
    s.gravity = DVec3::ZERO;
    // Down a direction that is not that of the indefinite tangent the last digits take hundreds of iterations.
    s.solver.tolerance = Solver::default().tolerance;
    // Along the axis of symmetry: π² E I/(4 L²) = 4.2 N buckle it, and it stays straight for want of a reason to go either way.
    let ends: Vec<DVec3> = [[0.0, 0.0], [0.03, 0.0], [0.0, 0.03], [0.03, 0.03]].map(|[y, z]| DVec3::new(0.1, y, z)).to_vec();
    let force = |f: f64| vec![DVec3::new(-0.25 * f, 0.0, 0.0); 4];
    s.effects = vec![driven("file-load", &[1.0], places(&ends), &[0.0, 1.0, 2.0], [force(1.0), force(3.0), force(5.0)].concat())];
    let failure = states(&planned(&s, Observation::default())).unwrap_err();
    assert_eq!(failure.kind, FailureKind::Unstable, "{failure}");
    assert!(failure.to_string().contains("state 2 of the sequence") && (failure.time - 2.0).abs() < 1e-12, "{failure}");
}

#[test]
fn points_that_the_body_does_not_have_are_refused() {
    let mut s = beam();
    let far = places(&[TIP[0], DVec3::new(0.1, 0.0, 0.2)]);
    for (points, said) in [
        (far, "load.0.places: 1 of 2 points lie more than"),
        (Points::Nodes(vec![3, 1_000_000]), "load.0.index: 1000000 (number 1) is no node"),
    ] {
        s.effects = vec![driven("file-load", &[1.0], points, &[0.0], vec![DVec3::X; 2])];
        let refused = build_plan(&s, Observation::default(), &[]).unwrap_err().to_string();
        assert!(refused.starts_with(said), "{refused}");
    }
}
