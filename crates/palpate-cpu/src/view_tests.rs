//! Members of a batch that are compared with different recordings, or with parts of one, are what each of them is alone, bit by bit.

use crate::CpuBackend;
use crate::costs::tests::{Noise, seen};
use glam::DVec3;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::observation::{Camera, Frame, Observation, Recording, View};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::ALL;

/// Another recording of the block: its cameras, noise, frame times and readings are its own, and it is a step shorter.
fn other(plan: &Plan) -> Plan {
    let own = &plan.observation;
    let mut noise = Noise(23);
    let mut frames: Vec<Frame> = own.frames[1..].to_vec();
    let (start, dt) = (own.frames[0].time - 0.4 * plan.clock.step, plan.clock.step);
    for (f, step) in frames.iter_mut().zip([0.7, 2.4]) {
        f.time = start + step * dt;
        f.points.iter_mut().for_each(|p| p.position += 1e-3 * DVec3::splat(noise.next()));
        f.points.truncate(f.points.len() / 2);
        f.points.iter_mut().step_by(2).for_each(|p| p.camera = 1);
        f.displacements.truncate(7);
    }
    // Tracked points in another order: sites belong to a recording.
    let mut observation = Observation { frames, ..(**own).clone() };
    observation.markers.swap(1, 3);
    observation.cameras.push(Camera::Pinhole { center: DVec3::new(-0.5, 0.1, 0.3), axis: DVec3::X });
    observation.channels.iter_mut().for_each(|c| c.noise *= 1.5);
    let mut plan = Plan { observation: observation.into(), ..plan.clone() };
    plan.clock.steps -= 1;
    plan
}

/// The plan without some frames.
fn without(plan: &Plan, left_out: impl Fn(usize) -> bool) -> Plan {
    let mut observation = (*plan.observation).clone();
    let mut number = 0..;
    observation.frames.retain(|_| !left_out(number.next().unwrap_or(0)));
    Plan { observation: observation.into(), ..plan.clone() }
}

fn alone(plan: &Plan, theta: &[f64], request: &Request) -> Evaluation {
    Rollout::new(CpuBackend, plan, 1).unwrap().evaluate(&ParamBatch::of(theta), request).remove(0)
}

#[test]
fn members_with_recordings_and_parts_of_them_are_what_they_are_alone() {
    for scheme in ALL {
        let mut plan = seen();
        plan.clock.scheme = scheme;
        let short = other(&plan);
        let both =
            Plan { others: vec![Recording { observation: short.observation.clone(), steps: short.clock.steps }], ..plan.clone() };
        let mut softer = plan.theta.clone();
        softer[0] *= 0.7;
        let (own, frames) = (&plan.theta, plan.observation.frames.len());
        // Views, the same plan alone, and θ.
        let all = [
            (View::default(), plan.clone(), own),
            (View::of(1), short.clone(), &softer),
            (View::of(0).without(frames, |f| f == 1), without(&plan, |f| f == 1), &softer),
            (View::of(1).without(2, |f| f == 1), without(&short, |f| f == 1), own),
            (View::of(0).without(frames, |f| f != 1), without(&plan, |f| f != 1), own),
        ];
        let sensitivities: Vec<usize> = (0..plan.layout.len()).collect();
        let batch = ParamBatch::from_rows(&all.iter().map(|a| a.2.clone()).collect::<Vec<_>>());
        let batch = batch.seeing(all.iter().map(|a| a.0.clone()).collect());
        for request in [
            Request { gradient: Wanted::All, sensitivities: Vec::new() },
            Request { gradient: Wanted::Nothing, sensitivities: sensitivities.clone() },
        ] {
            // All at once, and in parts of two.
            for most in [all.len(), 2] {
                let found = Rollout::new(CpuBackend, &both, most).unwrap().evaluate(&batch, &request);
                for ((view, plan, theta), e) in all.iter().zip(&found) {
                    assert_eq!(*e, alone(plan, theta, &request), "{}, {view:?}", scheme.name);
                    assert!(e.failure.is_none() && e.residuals == plan.observation.residuals() && e.matched > 0);
                }
                assert!(found.windows(2).all(|w| w[0].cost != w[1].cost));
            }
        }
        let v: Vec<f64> = own.iter().map(|t| 1e-3 * t.abs()).collect();
        let mut rollout = Rollout::new(CpuBackend, &both, 1).unwrap();
        for (view, plan, theta) in &all {
            let found = rollout.product(&ParamBatch::of(theta).seeing(vec![view.clone()]), &v, &Wanted::All);
            let right = Rollout::new(CpuBackend, plan, 1).unwrap().product(&ParamBatch::of(theta), &v, &Wanted::All);
            assert_eq!(found.unwrap(), right.unwrap(), "{}, {view:?}", scheme.name);
        }
    }
}

#[test]
fn members_with_sensitivities_of_their_own_are_what_they_are_alone() {
    let plan = seen();
    let short = other(&plan);
    let both = Plan { others: vec![Recording { observation: short.observation, steps: short.clock.steps }], ..plan.clone() };
    let all: Vec<usize> = (0..plan.layout.len()).collect();
    let own = vec![all[..3].to_vec(), all[2..].to_vec(), Vec::new(), vec![all[all.len() - 1], 0]];
    let views: Vec<View> = [0, 1, 0, 1].map(View::of).to_vec();
    let request = |places: &[usize]| Request { gradient: Wanted::Nothing, sensitivities: places.to_vec() };
    let mut rollout = Rollout::new(CpuBackend, &both, 4).unwrap();
    let batch = ParamBatch::from_rows(&vec![plan.theta.clone(); 4]).seeing(views.clone()).along(own.clone());
    let found = rollout.evaluate(&batch, &request(&own[1]));
    for ((view, places), e) in views.into_iter().zip(&own).zip(found) {
        let right = rollout.evaluate(&ParamBatch::of(&plan.theta).seeing(vec![view]), &request(places)).remove(0);
        assert!(e.failure.is_none() && e.curvature.as_ref().is_some_and(|c| c.gradient.len() == places.len()));
        // A member without any has an empty matrix; where nobody asks there is none.
        let curvature = Some(right.curvature.unwrap_or_default());
        assert_eq!(e, Evaluation { curvature, ..right });
    }
}

#[test]
fn what_a_member_would_meet_after_its_recording_does_not_matter() {
    let plan = seen();
    let short = other(&plan);
    let both = Plan { others: vec![Recording { observation: short.observation.clone(), steps: 1 }], ..plan.clone() };
    let batch = |theta: &[f64], view| ParamBatch::of(theta).seeing(vec![view]);
    // A few body lengths a step, so that it leaves the world within the second step and not within the first.
    let mut fast = plan.theta.clone();
    let place = plan.layout.index(palpate_model::params::ParamKey::Velocity(2));
    fast[place] = 0.6 * palpate_model::plan::WORLD_SIZE * plan.body.size() / plan.clock.step;
    let mut rollout = Rollout::new(CpuBackend, &both, 1).unwrap();
    let request = Request { gradient: Wanted::All, sensitivities: Vec::new() };
    let whole = rollout.evaluate(&batch(&fast, View::default()), &request).remove(0);
    assert!(whole.failure.is_some(), "{whole:?}");
    let part = rollout.evaluate(&batch(&fast, View::of(1)), &request).remove(0);
    assert!(part.failure.is_none() && part.cost.is_finite(), "{part:?}");
}
