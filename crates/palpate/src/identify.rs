//! What a recording would determine, before anything is fitted: expected errors of every free number, or of parts of a field, from the
//! sensitivities at the scene's own values; and which second motion, seen in the same way, would help most.
//!
//! A second motion tells of what both share: material, effects, gravity, masses, fields. How it starts and when is its own and taken as
//! known. What it is worth is ½ ln det(H₁ + H₂)/det(H₁), the information that it adds (D-optimal design).

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FreeNumber, check, errors, fingerprint, free_parameters};
use crate::motions::{Motion, motions};
use crate::render::{Pinhole, Sensor};
use crate::results::inspection::{Expectation, Identification, Proposal};
use crate::synthetic::{Observers, observe};
use crate::viewers::viewers;
use glam::DVec3;
use palpate_fit::{Expected, FitScene, FreeParameter, Problem, expected};
use palpate_model::observation::{Frame, Observation, ObservedDisplacement, ObservedMarker, ReadingKind};
use palpate_model::params::{On, ParamKey, Transform};
use palpate_model::scene::ObservationSpec;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Correlation from which on two numbers are named together, as after a fit.
const CORRELATED: f64 = 0.95;
/// Values of a field that are looked at one by one; of more, parts.
const ONE_BY_ONE: usize = 64;
/// Parts of a field along each side of the body.
const PARTS: usize = 4;

/// Numbers that are looked at together: a name, and places among the free values.
struct Group {
    name: String,
    unit: String,
    transform: Transform,
    /// Value of a number; 1, as a factor, of a part of a field.
    value: f64,
    /// How much of the unit one in z is.
    slope: f64,
    values: Vec<usize>,
}

/// What the scene's recording would determine, and which second motion would help most.
///
/// # Errors
/// As [`crate::fit`], and where the scene's own motion cannot be simulated. A second motion that cannot be is left out, with a warning.
///
/// `hear` is told which motion is looked at, and how many of how many numbers and parts of it are done.
pub(crate) fn identify(
    e: &Experiment,
    backend: Backend,
    mut hear: impl FnMut(&str, [usize; 2]),
) -> Result<Identification, Error> {
    let own = std::slice::from_ref(e);
    check(own)?;
    let (numbers, free, _) = free_parameters(own)?;
    let own_motion = "the scene's own motion";
    let (groups, first) = look(e, &numbers, &free, backend, None, &mut |done| hear(own_motion, done))?;
    let expectation = |(k, g): (usize, &Group)| {
        let error = first.errors[k];
        let with = (0..groups.len()).filter(|o| *o != k && first.correlation[k][*o].abs() > CORRELATED);
        Expectation {
            path: g.name.clone(),
            value: g.value,
            error: error * g.slope,
            unit: g.unit.clone(),
            relative: matches!(g.transform, Transform::Log | Transform::Relative).then_some(error),
            determined: first.told[k],
            gain: first.gain[k],
            with: with.map(|o| groups[o].name.clone()).collect(),
        }
    };
    let expectations: Vec<Expectation> = groups.iter().enumerate().map(expectation).collect();
    let (mut proposals, mut warnings) = (Vec::new(), Vec::new());
    for motion in motions(e) {
        let both = trial(e, &motion, backend)
            .and_then(|second| look(e, &numbers, &free, backend, Some(&second), &mut |done| hear(&motion.what, done)));
        match both {
            Ok((_, both)) => proposals.push(Proposal {
                motion: motion.what,
                information: both.information - first.information,
                errors: both.errors.iter().zip(&groups).map(|(error, g)| error * g.slope).collect(),
            }),
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => warnings.push(format!("{} could not be simulated: {why}", motion.what)),
        }
    }
    proposals.sort_by(|a, b| b.information.total_cmp(&a.information));
    Ok(Identification { residuals: first.residuals, numbers: expectations, motions: proposals, warnings })
}

/// Expected errors with the scene's own recording, and with a second motion beside it.
fn look(
    e: &Experiment,
    numbers: &[FreeNumber],
    free: &[FreeParameter],
    backend: Backend,
    second: Option<&Experiment>,
    hear: &mut dyn FnMut([usize; 2]),
) -> Result<(Vec<Group>, Expected), Error> {
    let mut scenes = Vec::new();
    for e in std::iter::once(e).chain(second) {
        scenes.push(FitScene {
            name: e.scene().path.display().to_string(),
            fingerprint: fingerprint(e.plan()),
            base: e.plan().theta.clone(),
            evaluate: backend.evaluator(e.plan(), 1)?,
        });
    }
    let shared = |n: &FreeNumber| !["initial.", "time.", "plane."].iter().any(|p| n.path.starts_with(p));
    let mut free = free.to_vec();
    for (f, n) in free.iter_mut().zip(numbers) {
        if second.is_some() && shared(n) {
            f.slots.push(palpate_fit::Slot { scene: 1, ..f.slots[0] });
        }
        // What is started from does not matter here, and the scene's own value may lie elsewhere.
        f.start = (f.bounds.0.max(f.start.0), f.bounds.1.min(f.start.1));
    }
    let problem = Problem::new(scenes, free);
    let mut problem = problem.map_err(|why| Error::scene(&e.scene().path, "fit.parameter", why))?;
    let values = problem.own_values();
    let groups = groups(e, numbers, &problem, &values);
    let places: Vec<Vec<usize>> = groups.iter().map(|g| g.values.clone()).collect();
    let model = errors(std::slice::from_ref(e));
    hear([0, places.len()]);
    let each = &mut |done| hear([done, places.len()]);
    let found = expected(&mut problem, &values, &places, &model, each).map_err(Error::Failed)?;
    Ok((groups, found))
}

/// Every free number by itself; of fields with many values, parts of the body.
fn groups(e: &Experiment, numbers: &[FreeNumber], problem: &Problem, values: &[f64]) -> Vec<Group> {
    let plan = e.plan();
    let mut out = Vec::new();
    for ((f, range), n) in problem.blocks().zip(numbers) {
        let chart = &problem.charts()[range.start];
        let slope = chart.slope(chart.coordinate(values[range.start]));
        let group = |name: String, value: f64, slope: f64, values: Vec<usize>| Group {
            name,
            unit: f.unit.clone(),
            transform: f.transform,
            value,
            slope,
            values,
        };
        if f.count <= ONE_BY_ONE {
            for (k, i) in range.enumerate() {
                let name = if f.count == 1 { n.label() } else { format!("{}.{k}", n.label()) };
                let slope = chart.slope(chart.coordinate(values[i]));
                out.push(group(name, values[i], slope, vec![i]));
            }
            continue;
        }
        let Some(On::Field(field)) = plan.layout.keys.get(f.slots[0].place).map(|k: &ParamKey| k.on()) else {
            out.push(group(n.label(), values[range.start], slope, range.collect()));
            continue;
        };
        let places = plan.fields[usize::from(field)].varied.places(&plan.body);
        let (low, high) = plan.body.corners;
        let part = |x: DVec3| -> [usize; 3] {
            let share = (x - low) / (high - low).max(DVec3::splat(1e-12));
            [0, 1, 2].map(|a| ((share[a] * PARTS as f64) as usize).min(PARTS - 1))
        };
        let mut parts = std::collections::BTreeMap::<[usize; 3], Vec<usize>>::new();
        for (k, i) in range.enumerate() {
            parts.entry(part(places[k])).or_default().push(i);
        }
        let size = (high - low) / PARTS as f64;
        for (p, values) in parts {
            let from = low + DVec3::from_array(p.map(|k| k as f64)) * size;
            let name = format!("{} around {:.4} m", n.label(), from + 0.5 * size);
            out.push(group(name, 1.0, 1.0, values));
        }
    }
    out
}

/// The scene in another motion, watched by the same sensors at the same times.
fn trial(e: &Experiment, motion: &Motion, backend: Backend) -> Result<Experiment, Error> {
    let mut other = motion.of(e);
    let own = &e.plan().observation;
    // What cameras see of another motion has to be looked at; where markers, points and nodes would be does not matter for sensitivities.
    let mut seen = if own.readings(ReadingKind::Depth) > 0 { depths(e, &other, backend)? } else { own.without_frames() };
    let mut frames: Vec<Frame> = std::mem::take(&mut seen.frames);
    for f in own.frames.iter().filter(|f| !f.markers.is_empty() || !f.displacements.is_empty()) {
        let at = frames.iter().position(|g| (g.time - f.time).abs() < 1e-9);
        let at = at.unwrap_or_else(|| {
            frames.push(Frame { time: f.time, ..Frame::default() });
            frames.len() - 1
        });
        frames[at].markers = f.markers.iter().map(|m| ObservedMarker { ..*m }).collect();
        frames[at].displacements = f.displacements.iter().map(|d| ObservedDisplacement { ..*d }).collect();
    }
    frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    other.plan.observation = Arc::new(Observation { frames, ..own.without_frames() });
    Ok(other)
}

/// Depth points of another motion as the recording's cameras and scanners would see them.
fn depths(e: &Experiment, other: &Experiment, backend: Backend) -> Result<Observation, Error> {
    let own = &e.plan().observation;
    let times = own.frames.iter().filter(|f| !f.points.is_empty()).map(|f| f.time).collect();
    let (numbers, cameras): (Vec<u32>, Vec<Pinhole>) = viewers(e).into_iter().unzip();
    let observers = Observers {
        cameras,
        markers: Vec::new(),
        points: Vec::new(),
        displacements: false,
        times,
        // Readings without error, to 13 m.
        sensor: Sensor { noise: 0.0, dropout: 0.0, depth_scale: 2e-4, seed: 1 },
    };
    let recording = observe(other, backend, &observers, |_| ControlFlow::Continue(()))?;
    let whole = ObservationSpec::new("", vec![ReadingKind::Depth]);
    let stride = e.scene().observation.as_ref().map_or(1, |o| o.pixel_stride);
    let spec = ObservationSpec { pixel_stride: stride, ..whole };
    let (mut seen, _) = recording.observation(&spec, &mut Vec::new()).map_err(|why| Error::Failed(why.to_string()))?;
    seen.frames.iter_mut().flat_map(|f| &mut f.points).for_each(|p| p.camera = numbers[p.camera as usize]);
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hanging rod whose end is tracked, at rest: how stiff it is shows, how it contracts sideways does not.
    const ROD: &str = r#"
        format = "scene/1"
        [object]
        shape = { box = { min = [0, 0, 0], max = [0.01, 0.01, 0.08] } }
        cell_size = 0.005
        [material]
        density = 1000.0
        youngs_modulus = 2.0e4
        poisson_ratio = 0.3
        stiffness_damping = 0.002
        [[clamp]]
        box = { min = [-1, -1, 0.0799], max = [1, 1, 1] }
        [initial]
        state = "static-equilibrium"
        [time]
        step = 0.005
        steps = 40
        [[target]]
        time = 0.1
        tolerance = 1e-4
        points = [[0.005, 0.005, 0], [0.005, 0, 0.03]]
        positions = [[0.005, 0.005, 0], [0.005, 0, 0.03]]
        [[target]]
        time = 0.2
        tolerance = 1e-4
        points = [[0.005, 0.005, 0], [0.005, 0, 0.03]]
        positions = [[0.005, 0.005, 0], [0.005, 0, 0.03]]
        [fit]
        [[fit.parameter]]
        path = "material.youngs_modulus"
        [[fit.parameter]]
        path = "material.stiffness_damping"
    "#;

    #[test]
    fn what_rests_says_nothing_of_damping_and_a_shake_would() {
        let e = Experiment::from_toml(ROD, "rod.toml").unwrap_or_else(|e| panic!("{e}"));
        let mut heard = 0;
        let found =
            identify(&e, Backend::Cpu, |_, [done, of]| heard += usize::from(done == of)).unwrap_or_else(|e| panic!("{e}"));
        println!("{found:#?}");
        let of = |path: &str| found.numbers.iter().find(|n| n.path == path).unwrap();
        assert!(of("material.youngs_modulus").determined && !of("material.stiffness_damping").determined);
        assert_eq!(heard, 1 + found.motions.len());
        let best = &found.motions[0];
        assert!(best.motion.starts_with("the clamps shaken"), "{}", best.motion);
        assert!(best.errors[1] < 1e-3 * of("material.stiffness_damping").error && best.information > 1.0, "{best:?}");
        // More readings never tell less.
        assert!(found.motions.iter().all(|m| m.information > -1e-9));
    }
}
