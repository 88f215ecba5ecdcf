//! The comparison of observation kernels with the CPU sees one percent of whatever they are made of.

use super::tests::{ball_plan, differences, expected, found};
use crate::GpuBackend;
use crate::tests::scenes::device;
use palpate_model::body::Body;
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use std::sync::Arc;

fn body(plan: &mut Plan) -> &mut Body {
    Arc::make_mut(&mut plan.body)
}

fn seen(plan: &mut Plan) -> &mut Observation {
    Arc::make_mut(&mut plan.observation)
}

/// Where the fault is, and what makes it.
type Fault = (&'static str, fn(&mut Plan));

const FAULTS: [Fault; 5] = [
    ("weights of the extension", |p| body(p).band.values.iter_mut().for_each(|w| *w *= 1.01)),
    ("distances", |p| body(p).band.cells.iter_mut().for_each(|c| c.sdf.iter_mut().for_each(|d| *d *= 1.01))),
    ("width of the kernel", |p| p.band *= 1.01),
    ("noise of markers", |p| seen(p).marker_noise *= 1.01),
    ("stalk of a marker", |p| seen(p).markers[2].stalk *= 1.01),
];

#[test]
fn one_percent_of_everything_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let right = ball_plan();
    let exact = expected(&right, 0);
    for (name, fault) in FAULTS {
        let mut wrong = right.clone();
        fault(&mut wrong);
        let off = differences(&found(&backend, &wrong, 1, None)[0], &exact);
        println!("{name}: {off:?}");
        assert!(!off.is_empty(), "1 % of {name} was not seen");
    }
}
