//! Members that are compared with different recordings, or with parts of one, have the bits that each of them has alone; and a batch of them
//! takes as many dispatches as its longest member.

use super::product_tests::plan;
use super::rollout_tests::watched;
use super::tests::Noise;
use crate::GpuBackend;
use crate::device::Gpu;
use crate::tests::scenes::{device, held};
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::{Effect, Unstated, find};
use palpate_model::observation::{Camera, MarkerRest, Observation, Recording, View};
use palpate_model::params::ParamKey;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::ALL;
use palpate_model::plan::{Plan, WORLD_SIZE};
use palpate_model::scene::{InitialShape, Scene};
use std::sync::Arc;

/// Another recording of the same body: cameras, noise, frame times, markers and readings are its own, and it is a step shorter.
fn other(scene: &Scene, plan: &Plan) -> Plan {
    let mut noise = Noise(23);
    let mut observation = (*plan.observation).clone();
    observation.frames.remove(0);
    let places = [plan.body.patches[3].point, plan.body.patches[40].point];
    let rest = places.map(|position| MarkerRest { name: format!("{position}"), position, surface: None });
    for f in &mut observation.frames {
        f.time -= 0.3 * plan.clock.step;
        f.points.iter_mut().for_each(|p| p.position += 1e-3 * noise.vector());
        f.points.truncate(f.points.len() / 2);
        f.points.iter_mut().step_by(2).for_each(|p| p.camera = 2);
        let mut more = f.markers[0];
        (more.site, more.position) = (1, places[1] + 1e-3 * noise.vector());
        f.markers.insert(0, more);
        f.displacements.truncate(7);
    }
    observation.cameras.push(Camera::Pinhole { center: glam::DVec3::new(0.1, 1.0, 0.2), axis: -glam::DVec3::Y });
    observation.channels.iter_mut().for_each(|c| c.noise *= 1.5);
    let observation = build_plan(scene, observation, &rest).unwrap_or_else(|e| panic!("{e}")).observation;
    let mut plan = Plan { observation, ..plan.clone() };
    plan.clock.steps -= 1;
    plan
}

/// The plan without some frames.
fn without(plan: &Plan, left_out: impl Fn(usize) -> bool) -> Plan {
    let mut number = 0..;
    let mut observation: Observation = (*plan.observation).clone();
    observation.frames.retain(|_| !left_out(number.next().unwrap_or(0)));
    Plan { observation: observation.into(), ..plan.clone() }
}

/// A plan with both recordings, and views of it with the plan that each is alone, and θ.
fn members(scene: &Scene) -> (Plan, Vec<(View, Plan, Vec<f64>)>) {
    let plan = plan(scene);
    let short = other(scene, &plan);
    let others = vec![Recording { observation: short.observation.clone(), steps: short.clock.steps }];
    let both = Plan { others, ..plan.clone() };
    let own = plan.theta.clone();
    let mut softer = own.clone();
    softer[plan.layout.index(ParamKey::YoungsModulus)] *= 0.8;
    let [frames, fewer] = [&plan, &short].map(|p| p.observation.frames.len());
    let all = vec![
        (View::of(1), short.clone(), own.clone()),
        (View::default(), plan.clone(), own.clone()),
        (View::of(0).without(frames, |f| f == 1), without(&plan, |f| f == 1), softer.clone()),
        (View::of(1).without(fewer, |f| f == 0), without(&short, |f| f == 0), softer),
        (View::of(0).without(frames, |f| f != 1), without(&plan, |f| f != 1), own),
    ];
    (both, all)
}

fn rollout(gpu: &Arc<Gpu>, plan: &Plan, members: usize) -> Rollout<GpuBackend> {
    Rollout::new(GpuBackend::on(gpu.clone()), plan, members).unwrap_or_else(|e| panic!("{e}"))
}

fn alone(gpu: &Arc<Gpu>, plan: &Plan, theta: &[f64], request: &Request) -> Evaluation {
    rollout(gpu, plan, 1).evaluate(&ParamBatch::of(theta), request).remove(0)
}

fn batch(all: &[(View, Plan, Vec<f64>)]) -> ParamBatch {
    let rows: Vec<Vec<f64>> = all.iter().map(|a| a.2.clone()).collect();
    ParamBatch::from_rows(&rows).seeing(all.iter().map(|a| a.0.clone()).collect())
}

/// A held ball; effects on readings give every member shots of its own.
fn scene(moved: bool) -> Scene {
    let mut scene = held(0.03);
    scene.observation = watched();
    scene.time.steps = 3;
    let kinds = if moved { vec!["marker-offset", "depth-bias", "time-offset"] } else { vec!["marker-offset"] };
    scene.effects = kinds.into_iter().map(|kind| Effect::absent(find(kind).unwrap())).collect();
    scene
}

#[test]
fn members_with_recordings_and_parts_of_them_have_the_bits_that_they_have_alone() {
    let Some(gpu) = device(None) else { return };
    for (moved, scheme) in [(false, &ALL[0]), (true, &ALL[1])] {
        let mut scene = scene(moved);
        scene.time.scheme = scheme;
        let (both, all) = members(&scene);
        let request = Request { gradient: Wanted::All, sensitivities: (0..both.layout.len()).step_by(3).collect() };
        let right: Vec<_> = all.iter().map(|(_, plan, theta)| alone(&gpu, plan, theta, &request)).collect();
        for most in [all.len(), 2] {
            let found = rollout(&gpu, &both, most).evaluate(&batch(&all), &request);
            for (((view, plan, _), right), e) in all.iter().zip(&right).zip(&found) {
                assert_eq!(e, right, "{}, {view:?}, {most} at once", scheme.name);
                assert!(e.failure.is_none() && e.residuals == plan.observation.residuals() && e.matched > 0, "{e:?}");
                assert!(e.gradient.iter().any(|g| *g != 0.0));
            }
            assert!(found.windows(2).all(|w| w[0].cost != w[1].cost));
        }
        let v: Vec<f64> = both.theta.iter().map(|t| 1e-3 * t.abs()).collect();
        let mut rollout_of_both = rollout(&gpu, &both, 1);
        for (view, plan, theta) in &all[..2] {
            let found = rollout_of_both.product(&ParamBatch::of(theta).seeing(vec![view.clone()]), &v, &Wanted::All);
            let right = rollout(&gpu, plan, 1).product(&ParamBatch::of(theta), &v, &Wanted::All);
            assert_eq!(found, right, "{}, {view:?}", scheme.name);
        }
    }
}

#[test]
fn members_with_sensitivities_of_their_own_have_the_bits_that_they_have_alone() {
    let Some(gpu) = device(None) else { return };
    let mut scene = scene(true);
    scene.time.steps = 2;
    // What changes along a direction is another array for each of the first three.
    let kinds = ["stiffness-gradient", "density-gradient", "rest-shape", "uniform-force"];
    scene.effects.extend(kinds.map(|kind| Effect::absent(find(kind).unwrap())));
    let both = members(&scene).0;
    let amplitude = |kind: &str| {
        let (law, range) = both.layout.effects().find(|(law, _)| law.kind == kind).unwrap();
        range.start + law.params.iter().position(|p| matches!(p.default, Unstated::Absent(_))).unwrap()
    };
    let [young, ratio] = [ParamKey::YoungsModulus, ParamKey::PoissonRatio].map(|k| both.layout.index(k));
    let own = vec![
        vec![young, amplitude("stiffness-gradient"), amplitude("depth-bias")],
        vec![young, amplitude("density-gradient")],
        vec![ratio, amplitude("rest-shape"), amplitude("time-offset")],
        vec![amplitude("marker-offset") + 1, amplitude("uniform-force")],
    ];
    let views: Vec<View> = [0, 1, 0, 1].map(View::of).to_vec();
    let request = |places: &[usize]| Request { gradient: Wanted::Nothing, sensitivities: places.to_vec() };
    let mut rollout = rollout(&gpu, &both, 4);
    let batch = ParamBatch::from_rows(&vec![both.theta.clone(); 4]).seeing(views.clone()).along(own.clone());
    let found = rollout.evaluate(&batch, &request(&own[0]));
    for ((view, places), e) in views.into_iter().zip(&own).zip(found) {
        let right = rollout.evaluate(&ParamBatch::of(&both.theta).seeing(vec![view]), &request(places)).remove(0);
        assert!(e.failure.is_none(), "{e:?}");
        assert_eq!(e, right, "{places:?}");
        let c = e.curvature.unwrap();
        assert!((0..places.len()).all(|q| c.matrix[q * places.len() + q] > 0.0), "{places:?}: {c:?}");
    }
}

#[test]
fn what_a_member_would_meet_after_its_recording_does_not_matter() {
    let Some(gpu) = device(None) else { return };
    let mut free = scene(false);
    free.clamps.clear();
    free.initial.state = InitialShape::Rest;
    let plan = plan(&free);
    let short = Recording { observation: other(&free, &plan).observation, steps: 1 };
    let both = Plan { others: vec![short], ..plan.clone() };
    // It leaves the world within the second step and not within the first.
    let mut fast = plan.theta.clone();
    fast[plan.layout.index(ParamKey::Velocity(2))] = 0.6 * WORLD_SIZE * plan.body.size() / plan.clock.step;
    let request = Request { gradient: Wanted::All, sensitivities: Vec::new() };
    let views = vec![View::default(), View::of(1)];
    let found = rollout(&gpu, &both, 2).evaluate(&ParamBatch::from_rows(&[fast.clone(), fast]).seeing(views), &request);
    assert!(found[0].failure.is_some(), "{:?}", found[0]);
    assert!(found[1].failure.is_none() && found[1].cost.is_finite(), "{:?}", found[1]);
}

#[test]
fn a_batch_of_recordings_and_folds_is_one_list_of_dispatches() {
    let Some(gpu) = device(None) else { return };
    let (both, all) = members(&scene(false));
    let request = Request { gradient: Wanted::Nothing, sensitivities: vec![both.layout.index(ParamKey::YoungsModulus)] };
    let recorded = |plan: &Plan, batch: &ParamBatch| {
        let mut rollout = rollout(&gpu, plan, batch.members());
        rollout.world_mut().count_dispatches(true).unwrap_or_else(|e| panic!("{e}"));
        let found = rollout.evaluate(batch, &request);
        assert!(found.iter().all(|e| e.failure.is_none()));
        rollout.world_mut().dispatches().recorded
    };
    let apart: u64 = all.iter().map(|(_, plan, theta)| recorded(plan, &ParamBatch::of(theta))).sum();
    let together = recorded(&both, &batch(&all));
    println!("{} members: {apart} dispatches one by one, {together} together", all.len());
    // Five members of which the longest alone would take a fifth, some looks and the rest of shorter members on top.
    assert!(3 * together < apart, "{together} and {apart}");
}
