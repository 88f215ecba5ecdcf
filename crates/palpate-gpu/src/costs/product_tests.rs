//! Products with the Gauss–Newton matrix against those of the CPU backend, along directions of all parameters at once.

use super::rollout_tests::{seen, watched};
use super::tests::Noise;
use crate::GpuBackend;
use crate::tests::scenes::{device, held};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::{Effect, find};
use palpate_model::observation::{Channel, MarkerRest, ObservedDisplacement, ObservedMarker, ReadingKind};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::Scene;

/// A held ball that is seen in every way, with numbers of the measurement that residuals depend on beside the states.
pub(super) fn plan(scene: &Scene) -> Plan {
    // Their effects need markers, which come after.
    let depth = seen(&Scene { effects: Vec::new(), ..scene.clone() });
    let mut observation = (*depth.observation).clone();
    let mut noise = Noise(5);
    let place = depth.body.patches[3].point;
    observation.channels.extend([Channel::new(ReadingKind::Marker, 1e-3), Channel::new(ReadingKind::Displacement, 1e-3)]);
    for frame in &mut observation.frames {
        frame.markers.push(ObservedMarker { site: 0, position: place + 2e-3 * noise.vector() });
        frame.displacements = ObservedDisplacement::of_all(depth.body.nodes.iter().map(|_| 2e-3 * noise.vector()));
    }
    let marker = MarkerRest { name: "tip".into(), position: place, surface: None };
    build_plan(scene, observation, &[marker]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn products_with_the_gauss_newton_matrix_are_those_of_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let mut scene = held(0.03);
    scene.observation = watched();
    scene.effects = ["marker-offset", "depth-bias", "time-offset"].map(|kind| Effect::absent(find(kind).unwrap())).to_vec();
    for steps in [0, 3] {
        scene.time.steps = steps;
        let plan = plan(&scene);
        let p = plan.layout.len();
        let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let mut gpu = Rollout::new(GpuBackend::on(gpu.clone()), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let request = Request { sensitivities: (0..p).collect(), ..Request::default() };
        let e = cpu.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
        let matrix = e.curvature.unwrap_or_else(|| panic!("{:?}", e.failure)).matrix;
        // Every number counts alike: sizes differ by many powers of ten.
        let size: Vec<f64> = (0..p).map(|a| matrix[a * p + a].sqrt()).collect();
        let known: Vec<usize> = (0..p).filter(|a| size[*a] > 0.0).collect();
        assert!(known.len() > 8, "{known:?}");
        let mut noise = Noise(9);
        for chosen in [&known[..1], &known[..]] {
            let mut v = vec![0.0; p];
            chosen.iter().for_each(|a| v[*a] = noise.vector().x / size[*a]);
            let [found, right] = [&mut gpu as &mut dyn Evaluate, &mut cpu]
                .map(|e| e.product(&ParamBatch::of(&plan.theta), &v, &Wanted::All))
                .map(Result::unwrap);
            let length = known.iter().map(|a| (right[*a] / size[*a]).powi(2)).sum::<f64>().sqrt();
            let off = |b: &[f64]| known.iter().map(|a| (found[*a] - b[*a]).abs() / size[*a]).fold(0.0, f64::max) / length;
            println!("{steps} steps, {} numbers: {:.1e}", chosen.len(), off(&right));
            assert!(off(&right) < 1e-3, "{:.1e}", off(&right));
            // One percent of the largest entry shows.
            let largest =
                known.iter().copied().max_by(|a, b| (right[*a] / size[*a]).abs().total_cmp(&(right[*b] / size[*b]).abs()));
            let mut wrong = right.clone();
            wrong[largest.unwrap()] *= 1.01;
            assert!(off(&wrong) > 1e-3);
        }
    }
}
