//! The gradient by every kind of parameter: |J(θ + εd) − J(θ) − ε ∇J·d| falls as ε².
//!
//! Kinds come from a scene's layout and from the table of effects, so that a new one is tested without a line here.

use super::report::{Requirement, Row};
use super::scenes;
use glam::{DAffine3, DQuat, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::effects::driven::{Drive, Points};
use palpate_model::effects::law::Asks;
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{ALL, Effect, Law, Site, Unstated};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::mechanics::path::Path;
use palpate_model::mechanics::series::Series;
use palpate_model::observation::{Camera, Channel, Frame, MarkerRest, Observation, ObservedDisplacement, ObservedMarker};
use palpate_model::observation::{ObservedPoint, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Basis, Blend, FieldSpec, Region, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, Clamp, PointMass, Scene};
use palpate_model::shape::Placed;
use std::sync::Arc;

/// Sizes of ε over the parameter's own: each a quarter of the last, from a twentieth on.
const STEPS: usize = 9;
/// A remainder that stands this far above zero, over the cost, has three digits: solves leave some 1e-13 of it.
const CLEAR: f64 = 1e-10;

/// A ball that is thrown into a corner of two planes.
fn thrown() -> Scene {
    let mut s = scenes::body(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, -0.002, 0.057) }, 0.03);
    s.material.youngs_modulus = 5e3;
    s.material.poisson_ratio = 0.4;
    s.material.mass_damping = 0.3;
    s.material.stiffness_damping = 0.004;
    s.gravity = DVec3::new(0.4, -0.3, -9.0);
    let wall = scenes::plane(DVec3::new(1.0, 0.2, 0.1));
    s.planes = vec![
        scenes::plane(DVec3::new(0.1, 0.05, 1.0)),
        palpate_model::scene::Plane { point: DVec3::new(-0.045, 0.0, 0.0), ..wall },
    ];
    s.masses = vec![PointMass { point: DVec3::new(0.0, 0.02, 0.09), mass: 0.02 }];
    s.initial.velocity = DVec3::new(-0.3, 0.1, -0.8);
    s.initial.angular_velocity = DVec3::new(2.0, -5.0, 1.0);
    s.time = scenes::steps(0.01, 6);
    s.time.start = 0.002;
    s.solver.tolerance = 1e-13;
    s
}

/// The same with its back in a clamp, let go from rest.
fn held() -> Scene {
    let mut s = thrown();
    (s.initial.velocity, s.initial.angular_velocity) = (DVec3::ZERO, DVec3::ZERO);
    s.clamps = vec![Clamp::still(DVec3::new(-0.1, 0.021, 0.0), DVec3::new(0.1, 0.1, 0.2))];
    s
}

/// With two fields, one of regions and one of nodes.
fn varied() -> Scene {
    let mut s = thrown();
    let region = |z: f64, value: f64| Region { center: DVec3::new(0.0, 0.0, z), radius: 0.01, value };
    let regions = Basis::Regions(vec![region(0.03, 1.3), region(0.08, 0.8)], Blend::Harmonic);
    let of = |varied, basis| FieldSpec { varied, basis, scale: Scale::Log, values: None, prior: None };
    s.fields = vec![of(Varied::Modulus, regions), of(Varied::Density, Basis::Nodes), of(Varied::Modulus, Basis::Cells)];
    s
}

/// What is seen of a scene: displacements and a marker, or depth where what is tested concerns a camera; of a body 15 % stiffer, so that no
/// residual is zero, and between steps.
fn observed(scene: &Scene, depth: bool) -> Result<Plan, String> {
    let plain =
        build_plan(&Scene { effects: Vec::new(), ..scene.clone() }, Observation::default(), &[]).map_err(|e| e.to_string())?;
    let mut other = plain.clone();
    other.theta[other.layout.index(ParamKey::YoungsModulus)] *= 1.15;
    let states = scenes::states(&other)?;
    let cameras: Vec<Camera> = DVec3::AXES
        .into_iter()
        .flat_map(|a| [a, -a])
        .map(|a| Camera::Pinhole { center: DVec3::new(0.0, 0.0, 0.05) + a, axis: -a })
        .collect();
    let frame = |time: f64| {
        let k = ((time - scene.time.start) / scene.time.step).round() as usize;
        let u = &states[k].displacement;
        let point =
            |(number, (patch, place)): (usize, (&palpate_model::space::body::Patch, palpate_model::space::stencil::Stencil))| {
                let off = 0.002 * (1.0 + number as f64).sin();
                let position = patch.point + place.at(u) + off * patch.normal;
                let away = |c: &u32| cameras[*c as usize].center().map_or(f64::INFINITY, |p| p.distance(position));
                ObservedPoint { position, camera: (0..6).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0) }
            };
        let moved = |u: &DVec3| *u + DVec3::new(1e-4, -2e-4, 3e-4);
        Frame {
            time,
            points: if depth { plain.body.pieces().enumerate().map(point).collect() } else { Vec::new() },
            markers: vec![ObservedMarker { site: 0, position: DVec3::new(0.001, 0.012, 0.11) }],
            displacements: if depth {
                ObservedDisplacement::of_all(std::iter::empty())
            } else {
                ObservedDisplacement::of_all(u.iter().map(moved))
            },
            ..Frame::default()
        }
    };
    let frames = [0.0253, 0.0437, 0.0581].map(frame).into();
    let channels = vec![
        Channel::new(ReadingKind::Depth, 1e-3),
        Channel::new(ReadingKind::Marker, 2e-3),
        Channel::new(ReadingKind::Displacement, 5e-3),
    ];
    let marker =
        MarkerRest { name: "m".into(), position: DVec3::new(0.0, 0.01, 0.115), surface: Some(DVec3::new(0.0, 0.005, 0.107)) };
    let observation = Observation { cameras, frames, channels, ..Observation::default() };
    build_plan(scene, observation, &[marker]).map_err(|e| e.to_string())
}

/// Step from which on steps are so small that a point which jumps does so to another match, not by the step.
const SMALL: usize = 3;

/// Without the points that differences may take across a face of the distance's samples, where its slope jumps, and without those whose match
/// jumps over a small step of `places`, as it may where a fold of the body's surroundings offers two.
fn away_from_kinks(plan: Plan, places: &[usize]) -> Result<Plan, String> {
    let body = &plan.body;
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).map_err(|e| e.to_string())?;
    let mut rows_at = |theta: &[f64]| rollout.linearise(theta, &[0]).map(|l| l.rows.residuals).map_err(|e| e.to_string());
    let rows = rows_at(&plan.theta)?;
    let near = (SMALL..STEPS).map(|k| rows_at(&moved(&plan, places, k))).collect::<Result<Vec<_>, _>>()?;
    let jumps = |i: usize| near.iter().any(|r| r[i].value.is_none() || r[i].rest.distance(rows[i].rest) > 0.05 * body.length);
    let far = |rest: DVec3| {
        let place = (rest - body.cut().grid.position([0; 3])) * (SUBDIVISIONS as f64 / body.length);
        (place - place.round()).abs().min_element() > 0.05
    };
    let mut observation = (*plan.observation).clone();
    for (k, f) in observation.frames.iter_mut().enumerate() {
        let kept = rows
            .iter()
            .enumerate()
            .filter(|(i, r)| r.frame == k && r.value.is_some() && r.source.is_depth() && far(r.rest) && !jumps(*i));
        f.points = kept.map(|(_, r)| f.points[r.source.item as usize]).collect();
    }
    Ok(Plan { observation: observation.into(), ..plan })
}

/// Places that move, each by its own size.
fn direction(plan: &Plan, places: &[usize]) -> Vec<(usize, f64)> {
    let size = |i: usize| plan.layout.keys[i].spec().size_at(plan.theta[i]);
    // Of any sign and of unlike sizes, so that errors of two numbers do not cancel.
    places
        .iter()
        .enumerate()
        .map(|(k, i)| (*i, size(*i) * (0.6 + 0.4 * (2.0 + 3.0 * k as f64).sin()) * if k % 2 == 0 { 1.0 } else { -1.0 }))
        .collect()
}

/// ε of step k.
fn step(k: usize) -> f64 {
    0.05 * 0.25f64.powi(k as i32)
}

/// θ after step k.
fn moved(plan: &Plan, places: &[usize], k: usize) -> Vec<f64> {
    let mut theta = plan.theta.clone();
    direction(plan, places).iter().for_each(|(i, d)| theta[*i] += step(k) * d);
    theta
}

/// Order of the remainder in a direction in which all of `places` in θ move, each by its own size.
fn order(plan: &Plan, places: &[usize]) -> Result<f64, String> {
    let mut rollout = Rollout::new(CpuBackend, plan, STEPS).map_err(|e| e.to_string())?;
    let request = Request { gradient: Wanted::All, sensitivities: Vec::new() };
    let base = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    if let Some(f) = base.failure {
        return Err(f.to_string());
    }
    let direction = direction(plan, places);
    let costs = rollout
        .evaluate(&ParamBatch::from_rows(&(0..STEPS).map(|k| moved(plan, places, k)).collect::<Vec<_>>()), &Request::default());
    let slope: f64 = direction.iter().map(|(i, d)| base.gradient[*i] * d).sum();
    let remainder = |k: usize| (costs[k].cost - base.cost - step(k) * slope).abs();
    // The two shortest steps whose remainders are clear of rounding.
    let last = (1..STEPS).rev().find(|k| remainder(*k) > CLEAR * base.cost && remainder(*k).is_finite());
    Ok(last.map_or(f64::NAN, |k| (remainder(k - 1) / remainder(k)).ln() / 4f64.ln()))
}

/// An effect at work: amplitudes at a third of their typical size, directions along no axis.
fn at_work(number: usize, law: &Law) -> Effect {
    let mut effect = Effect::absent(number);
    for (value, p) in effect.values.iter_mut().zip(law.params) {
        if let Unstated::Absent(absent) = p.default {
            let sign = if p.axis == Some(1) { -1.0 } else { 1.0 };
            *value = Some((absent + sign * 0.3 * p.typical).clamp(p.lower, p.upper));
        }
        if let (true, Some(axis)) = (p.is_direction(), p.axis) {
            *value = Some([0.8, 0.5, 0.4][usize::from(axis)]);
        }
    }
    if law.asks() == Asks::Path {
        // Into the side of the ball, and on.
        let points = vec![DVec3::new(0.067, 0.0, 0.055), DVec3::new(0.06, 0.004, 0.053)];
        effect.path = Some(Arc::new(Path { times: vec![0.0, 0.07], points }));
    }
    if law.asks() == Asks::Series {
        let points = vec![DVec3::new(0.04, 0.0, 0.06), DVec3::new(0.0, 0.03, 0.08)];
        let late = DVec3::new(0.02, -0.01, 0.01);
        let vectors = [DVec3::ZERO, late].iter().flat_map(|d| points.iter().map(|p| *p + *d).collect::<Vec<_>>()).collect();
        let series = Arc::new(Series { count: 2, times: vec![0.0, 0.0703], vectors });
        effect.drive = Some(Arc::new(Drive { points: Points::Places(points, None), series, tracked: Vec::new() }));
    }
    if law.moves() {
        // Into the side of the ball, and a jet from there.
        let translations = vec![DVec3::new(0.076, 0.0, 0.055), DVec3::new(0.068, 0.004, 0.053)];
        let rotations = vec![DQuat::IDENTITY, DQuat::from_rotation_y(0.1)];
        let motion = RigidMotion { times: vec![0.0, 0.07], translations, rotations };
        let ball = Placed::new(Analytic::Ball { radius: 0.03, center: DVec3::ZERO }, DAffine3::IDENTITY);
        effect.moving = Some(Arc::new(match law.site {
            Site::Obstacle => Moving::obstacle(&ball, 0.002, motion),
            _ => Moving::nozzle(-DVec3::X, motion),
        }));
    }
    effect
}

/// Places in θ of what every scene and fields have, by kind: components of a vector, planes, and the first values of fields share theirs.
fn kinds(plan: &Plan) -> Vec<(String, Vec<usize>)> {
    let mut all: Vec<(String, Vec<usize>)> = Vec::new();
    for (place, key) in plan.layout.keys.iter().enumerate() {
        let path = key.spec().path;
        let kind = match key {
            ParamKey::Field { field, index } if *index < 4 => format!("field.{field}"),
            ParamKey::Field { .. } => continue,
            _ => path
                .split('.')
                .filter(|p| !["x", "y", "z"].contains(p) && p.parse::<u32>().is_err())
                .collect::<Vec<_>>()
                .join("."),
        };
        match all.iter_mut().find(|k| k.0 == kind) {
            Some(known) => known.1.push(place),
            None => all.push((kind, vec![place])),
        }
    }
    all
}

/// The study.
///
/// # Errors
/// A scene cannot be built or simulated.
pub fn run() -> Result<Vec<Row>, String> {
    let row = |what: String, count: usize, order: f64| {
        let what = if count == 1 { what } else { format!("{what}, {count} numbers together") };
        Row::new(what, Requirement::Between { least: 1.95, most: 2.05 }, order, "", "Taylor's theorem")
    };
    let mut rows = Vec::new();
    let plan = observed(&varied(), false)?;
    for (kind, places) in kinds(&plan) {
        rows.push(row(format!("`{kind}`"), places.len(), order(&plan, &places)?));
    }
    for (number, law) in ALL.iter().enumerate() {
        let mut scene = if matches!(law.site, Site::Clamps(_) | Site::Edges(_)) { held() } else { thrown() };
        scene.effects = vec![at_work(number, law)];
        let depth = matches!(law.site, Site::Readings(_));
        let plan = observed(&scene, depth)?;
        // A number that says which camera or marker is no parameter.
        let chosen = |key: &ParamKey| match key {
            ParamKey::Effect { slot, .. } => !matches!(law.params[usize::from(*slot)].default, Unstated::Choice(_)),
            _ => false,
        };
        let places: Vec<usize> = (0..plan.layout.len()).filter(|i| chosen(&plan.layout.keys[*i])).collect();
        let plan = if depth { away_from_kinks(plan, &places)? } else { plan };
        let found = order(&plan, &places).map_err(|e| format!("{}: {e}", law.kind))?;
        rows.push(row(format!("effect {}", law.kind), places.len(), found));
    }
    Ok(rows)
}
