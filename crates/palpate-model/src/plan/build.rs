//! From a scene and what was observed to a [`Plan`]: cuts the body, places clamps, planes, masses and markers, and fills θ.

mod driven;
mod memory;
mod obstacles;
mod sites;
mod stars;
mod tets;

pub use memory::plan_memory;
pub use sites::marker_sites;
pub use tets::{HELD, made, reference};

use crate::cutcells::build::{self as cutting, BodyError, Parts, SUBDIVISIONS};
use crate::cutcells::clamp_cell::held_cells;
use crate::cutcells::clamp_edge::Edge;
use crate::cutcells::cut::ClipBox;
use crate::cutcells::shadow::shadow;
use crate::effects::law::Asks;
use crate::effects::{Effect, Site, check_choices, impulse};
use crate::observation::{MarkerRest, Observation};
use crate::params::Layout;
use crate::params::ParamKey;
use crate::params::fields::{Field, Varied};
use crate::plan::{ClampSite, Clock, Plan, PlaneSite};
use crate::scene::{BodySource, Clamp, ClampRegion, Inertia, InitialShape, Resolution, Scene, Time};
use crate::shape::{Shape, shape_of};
use crate::space::body::Body;
use crate::space::stencil::Stencils;
use glam::DAffine3;
use std::sync::Arc;

/// Why a scene gives no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct PlanError {
    /// Key of the scene (`clamp.0.box`) or recording (`markers.rest "tip"`) concerned.
    pub key: String,
    /// What is wrong and what is allowed, with numbers.
    pub message: String,
}

fn error(key: impl Into<String>, message: String) -> PlanError {
    PlanError { key: key.into(), message }
}

/// Cuts a scene's body. The shape is returned with it.
pub fn build_body(scene: &Scene) -> Result<(Arc<Body>, Arc<dyn Shape>), PlanError> {
    let shape = shape_of(&scene.object);
    let parts = build_parts(scene, &shape, false)?;
    Ok((Arc::new(parts.body), shape))
}

/// `seen`: observed points are to be looked up; bodies of cells are always ready for them.
fn build_parts(scene: &Scene, shape: &Arc<dyn Shape>, seen: bool) -> Result<Parts, PlanError> {
    if let BodySource::Cloud(cloud) = &scene.object.source {
        return stars::parts(scene, cloud, shape.as_ref(), seen);
    }
    let mesh = match (&scene.object.source, scene.object.resolution) {
        (BodySource::Tetrahedra { mesh, .. }, _) => Some(mesh.transformed(&scene.object.pose)),
        (_, Resolution::Edge(_)) => Some(tets::made(&scene.object)?.0),
        _ => None,
    };
    if let Some(mesh) = mesh {
        tets::refuse_what_needs_cells(scene)?;
        let mut body = Body::of_tets(&mesh, scene.solver.tetrahedron);
        if seen {
            let (h, width) = (body.length, band_cells(scene) * body.length);
            body.band = shadow(&body, shape.as_ref(), h, width).map_err(|e| error("observation.band", e.to_string()))?;
        }
        return Ok(Parts { body, merged: Vec::new() });
    }
    let (min, max) = shape.bounds();
    let (key, h) = match scene.object.resolution {
        Resolution::CellSize(h) => ("object.cell_size", h),
        Resolution::Cells(n) => ("object.cells", (max - min).max_element() / f64::from(n)),
        Resolution::OpenEdge => return Err(error("object.edge_length", "is missing: how fine are the tetrahedra to be?".into())),
        Resolution::Own | Resolution::Open | Resolution::Edge(_) => {
            return Err(error("object.cell_size", "is missing: a shape has no cells of its own".into()));
        }
    };
    let mut parts = cutting::build_parts(shape.as_ref(), h, band_cells(scene) * h, SUBDIVISIONS).map_err(|e| {
        let key = if matches!(e, BodyError::Empty { .. }) { "object" } else { key };
        error(key, e.to_string())
    })?;
    // Only where the step is of second order: where it damps, heavy surfaces make up for some of what it takes from a body that lands.
    if scene.clamps.is_empty() && scene.time.scheme.is_of_second_order(scene.time.theta) {
        parts.body.mend_moments();
    }
    Ok(parts)
}

/// Width of the band in cells; without observation just enough to draw the surface.
fn band_cells(scene: &Scene) -> f64 {
    scene.observation.as_ref().map_or(1.0, |o| o.band)
}

/// Everything a backend needs for a scene. `observation` comes with frames, cameras and channels; its markers are filled here: one per
/// entry of `marker_rest` in the same order, then one per rest place of its tracks.
pub fn build_plan(scene: &Scene, observation: Observation, marker_rest: &[MarkerRest]) -> Result<Plan, PlanError> {
    build_plan_of(scene, shape_of(&scene.object), observation, marker_rest)
}

/// [`build_plan`] with the scene's shape at hand, which takes time to make of a large mesh.
pub fn build_plan_of(
    scene: &Scene,
    shape: Arc<dyn Shape>,
    mut observation: Observation,
    marker_rest: &[MarkerRest],
) -> Result<Plan, PlanError> {
    let parts = build_parts(scene, &shape, observation.frames.iter().any(|f| !f.points.is_empty()))?;
    let clamps =
        scene.clamps.iter().enumerate().map(|(i, c)| clamp_site(i, c, scene, &parts, &shape)).collect::<Result<Vec<_>, _>>()?;
    check_given(scene)?;
    let body = Arc::new(parts.body);
    let mut masses = Stencils::default();
    for (i, m) in scene.masses.iter().enumerate() {
        let key = format!("mass.{i}.point");
        let place = sites::mass_site(&key, m.point, &body)?;
        masses.push(&place.nodes, &place.value);
    }
    observation.markers = marker_sites(marker_rest, &body, shape.as_ref())?;
    observation.markers.extend(sites::track_sites(&observation.tracks, &body, shape.as_ref())?);
    sites::check_nodes(&observation, &body)?;
    // A scene that is only simulated concerns no camera.
    if !observation.frames.is_empty() {
        check_choices(&scene.effects, observation.camera_count(), observation.marker_count()).map_err(|(k, m)| error(k, m))?;
        let of_readings = |e: &Effect| matches!(e.law().site, Site::Readings(_));
        if let Some(i) = scene.effects.iter().position(of_readings).filter(|_| !observation.has_sight()) {
            let text =
                "acts along lines of sight, and no point that was measured has one; give `camera` or `origin` in [[cloud]]";
            return Err(error(format!("effect.{i}.kind"), text.into()));
        }
    }
    check_effects(scene, &body)?;
    check_departure(scene, &body)?;
    if scene.time.scheme.still {
        driven::check_held(scene)?;
    }
    let times = driven::times(scene, &observation);
    obstacles::check_apart(scene, times.first().copied().unwrap_or(scene.time.start), &body, shape.as_ref())?;
    let planes = scene
        .planes
        .iter()
        .map(|p| PlaneSite { polar_axis: PlaneSite::polar_axis_for(p.normal), stiffness: p.stiffness })
        .collect::<Vec<_>>();
    let (mut fields, mut starts) = (Vec::new(), Vec::new());
    for (i, spec) in scene.fields.iter().enumerate() {
        if spec.varied == Varied::Damping && scene.material.stiffness_damping == 0.0 {
            let text = "varies a number that is 0; give material.stiffness_damping (s)";
            return Err(error(format!("field.{i}.path"), text.into()));
        }
        fields.push(Field::new(spec, &body).map_err(|m| error(format!("field.{i}.regions"), m))?);
        starts.push(spec.start(&body).map_err(|m| error(format!("field.{i}.file"), m))?);
    }
    let driven = driven::sites(scene, &body)?;
    let layout = scene.layout_with(&fields.iter().map(|f| f.count).collect::<Vec<_>>());
    let time = clock_of(scene, &times);
    let clock = Clock { step: time.step, steps: time.steps, theta: time.theta, scheme: time.scheme };
    Ok(Plan {
        theta: theta(scene, &layout, &planes, &starts, &body, time.start),
        layout,
        model: scene.material.model,
        curves: scene.curves.clone(),
        fields,
        planes,
        clamps,
        masses,
        followed: scene.effects.iter().map(|e| e.path.clone()).collect(),
        driven,
        moving: scene.effects.iter().map(|e| e.moving.clone()).collect(),
        frames: Arc::new(sites::frames(scene.effects.iter().any(turns), &body)),
        clock,
        times,
        initial: match scene.initial.state {
            InitialShape::Rest if scene.time.scheme.still => InitialShape::StaticEquilibrium,
            state => state,
        },
        pivot: scene.initial.pivot.unwrap_or(body.center),
        observation: Arc::new(observation),
        others: Vec::new(),
        band: band_cells(scene) * body.length,
        solver: scene.solver,
        body,
    })
}

/// The scene's clock; that of a quasi-static sequence follows from when its states are.
fn clock_of(scene: &Scene, times: &[f64]) -> Time {
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return scene.time };
    let steps = times.len() - 1;
    let step = if steps > 0 { (last - first) / steps as f64 } else { 1.0 };
    Time { step, steps, start: *first, ..scene.time }
}

/// The scene's parameter values in the order of its layout.
fn theta(scene: &Scene, layout: &Layout, planes: &[PlaneSite], fields: &[Vec<f64>], body: &Body, start: f64) -> Vec<f64> {
    let m = &scene.material;
    let plane = |i: u16| (&scene.planes[i as usize], &planes[i as usize]);
    let value = |key: &ParamKey| match *key {
        ParamKey::YoungsModulus => m.youngs_modulus,
        ParamKey::PoissonRatio => m.poisson_ratio,
        ParamKey::Density => match m.inertia {
            Inertia::Density(d) => d,
            Inertia::Mass(mass) => mass / body.volume,
        },
        ParamKey::MassDamping => m.mass_damping,
        ParamKey::StiffnessDamping => m.stiffness_damping,
        ParamKey::Viscosity => m.viscosity.map_or(0.0, |v| v.coefficient),
        ParamKey::ViscosityExponent => m.viscosity.map_or(1.0, |v| v.exponent),
        ParamKey::StretchFactor(k) => scene.curves.stretch.factors[usize::from(k)],
        ParamKey::VolumeFactor(k) => scene.curves.volume.factors[usize::from(k)],
        ParamKey::Gravity(a) => scene.gravity[a as usize],
        ParamKey::Velocity(a) => scene.initial.velocity[a as usize],
        ParamKey::AngularVelocity(a) => scene.initial.angular_velocity[a as usize],
        ParamKey::TimeStart => start,
        ParamKey::PlaneHeight(i) => plane(i).0.normal.dot(plane(i).0.point),
        ParamKey::PlaneTheta(i) => plane(i).1.angles(plane(i).0.normal).0,
        ParamKey::PlanePhi(i) => plane(i).1.angles(plane(i).0.normal).1,
        ParamKey::PointMass(i) => scene.masses[i as usize].mass,
        ParamKey::Effect { effect, slot, .. } => scene.effects[effect as usize].value(slot as usize, body.center),
        ParamKey::Field { field, index } => fields[usize::from(field)][index as usize],
    };
    layout.keys.iter().map(value).collect()
}

/// What effects need of body and clock.
fn check_effects(scene: &Scene, body: &Body) -> Result<(), PlanError> {
    for (i, effect) in scene.effects.iter().enumerate() {
        let kind = effect.law().kind;
        let key = |name: &str| format!("effect.{i}.{name}");
        if effect.law().asks() == Asks::Path && effect.path.is_none() {
            return Err(error(
                key("path"),
                format!("is missing: a \"{kind}\" follows a path, the name of a CSV file or rows [time, x, y, z]"),
            ));
        }
        if kind == impulse::KIND && scene.time.steps > 0 {
            check_impulse(effect, scene.time.step).map_err(|message| error(key("duration"), message))?;
        }
    }
    for (i, handle) in scene.synthesis.handles.iter().enumerate() {
        let away = body.nodes.iter().map(|x| x.distance(handle.point)).fold(f64::INFINITY, f64::min);
        let allowed = GRASP * body.length;
        if away > allowed {
            let message = format!(
                "{} m lies {away:.4} m from the nearest node of the body; a handle holds on to it, within two cells ({allowed:.4} m)",
                handle.point
            );
            return Err(error(format!("handle.{i}.point"), message));
        }
    }
    Ok(())
}

/// True of effects that ask for normals which turn with the surface.
fn turns(effect: &Effect) -> bool {
    effect.law().asks() == Asks::Normal || matches!(effect.law().site, Site::Jet)
}

/// How far a handle may be from the nearest node, in cells.
const GRASP: f64 = 2.0;

/// An impulse must be seen by as many steps as its spline takes to sum to one.
fn check_impulse(effect: &Effect, step: f64) -> Result<(), String> {
    let duration = effect.values[impulse::DURATION].unwrap_or_default();
    let least = f64::from(impulse::LEAST_STEPS) * step;
    // Times are rounded.
    if duration >= least * (1.0 - 1e-9) {
        return Ok(());
    }
    Err(format!("{duration} s is shorter than {} steps ({least} s), so that steps would miss part of it", impulse::LEAST_STEPS))
}

/// A shape that is given as the equilibrium needs something that holds it.
fn check_given(scene: &Scene) -> Result<(), PlanError> {
    if scene.initial.state != InitialShape::Given || !scene.clamps.is_empty() {
        return Ok(());
    }
    Err(error("object.state", "\"static\" needs a [[clamp]]: nothing holds the body".into()))
}

/// A shape given under load that effects depart from: of cells alone.
fn check_departure(scene: &Scene, body: &Body) -> Result<(), PlanError> {
    let departs = scene.effects.iter().position(|e| matches!(e.law().site, Site::Rest(_)));
    match departs.filter(|_| scene.initial.state == InitialShape::Given && body.cut.is_none()) {
        // Derivatives by Poisson's ratio have been seen 3e-5 off there.
        Some(i) => {
            let text =
                "changes the stress-free shape of tetrahedra, which follows from object.state = \"static\"; cells have both";
            Err(error(format!("effect.{i}.kind"), text.into()))
        }
        None => Ok(()),
    }
}

fn clamp_site(i: usize, clamp: &Clamp, scene: &Scene, parts: &Parts, shape: &Arc<dyn Shape>) -> Result<ClampSite, PlanError> {
    let body = &parts.body;
    if !body.points.is_empty() {
        return tets::clamp_site(i, clamp, scene, body, shape);
    }
    let ClampRegion::Box { min, max, object_frame } = clamp.region else {
        let message =
            "names a group of a volume mesh, and this body is cut out of a lattice: give a box, or a volume_mesh with groups";
        return Err(error(format!("clamp.{i}.group"), message.into()));
    };
    let to_frame = if object_frame { scene.object.pose.inverse() } else { DAffine3::IDENTITY };
    let region = ClipBox { to_frame, min, max };
    let cells = held_cells(&region, parts, shape.as_ref());
    if cells.is_empty() {
        let (lo, hi) = shape.bounds();
        return Err(error(
            format!("clamp.{i}.box"),
            format!(
                "the box from {min} to {max} m ({}) holds no part of the body, which lies between {lo} and {hi} m (world); \
                 move or enlarge the box",
                if object_frame { "in the object's own frame" } else { "world" }
            ),
        ));
    }
    let edge = Edge::new(shape.clone(), SUBDIVISIONS, region, parts.merged.clone());
    Ok(ClampSite { cells, nodes: Vec::new(), areas: Vec::new(), motion: clamp.motion.clone(), edge: Arc::new(edge) })
}

#[cfg(test)]
#[path = "build_tests.rs"]
mod tests;
