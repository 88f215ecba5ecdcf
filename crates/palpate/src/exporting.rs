//! From an experiment to what `palpate-export` writes: a mesh of tetrahedra, and the numbers, clamps and world of the scene.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::options::stem;
use glam::{DAffine3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::Snapshot;
use palpate_export::fill::{Filled, fill, in_frame};
use palpate_export::{Clock, Displacement, Ground, Held, Material, Mesh, PointMass, Specimen, Spin};
use palpate_model::cutcells::cut::ClipBox;
use palpate_model::mechanics::plane::planes;
use palpate_model::params::fields::Varied;
use palpate_model::plan::build::made;
use palpate_model::plan::{Physics, Plan};
use palpate_model::scene::{BodySource, ClampRegion, InitialShape, Object, Resolution, Scene, Tetrahedron};
use palpate_model::shape::shape_of;
use palpate_model::space::points::TetMesh;
use palpate_model::space::tets::EDGES;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

/// What an export leaves open.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExportOptions {
    /// Longest edge of tetrahedra that are made [m]; `None` = the edge of a cell.
    pub edge_length: Option<f64>,
    /// Quadratic elements; `None` = quadratic, unless the scene's own are linear.
    pub quadratic: Option<bool>,
}

/// The body of an experiment as tetrahedra in the world.
struct Tets {
    mesh: TetMesh,
    /// Corners that each clamp holds, increasing.
    held: Vec<Vec<u32>>,
    /// Volume that its mesh was to have [m³].
    volume: f64,
    /// True where they are the scene's own, element by element.
    own: bool,
}

/// An experiment as a specimen with quadratic elements where these are wanted, and the volume of the shape [m³].
///
/// # Errors
/// The edge does not suit the shape, a clamp holds nothing of the mesh, or the state at the start cannot be computed.
pub fn specimen<'a>(e: &'a Experiment, options: &ExportOptions) -> Result<(Specimen<'a>, f64), Error> {
    let (scene, plan) = (e.scene(), e.plan());
    let physics = Physics::new(&plan.layout, &plan.theta);
    let regions = regions(scene, plan);
    let mut tets = tetrahedra(e, &regions, options)?;
    let moduli = moduli(plan, &physics, &tets);
    let densities = densities(plan, &physics, &tets);
    let start = start(e, &mut tets)?;
    let quadratic = options.quadratic.unwrap_or(!tets.own || scene.solver.tetrahedron == Tetrahedron::Quadratic);
    let mesh = Mesh::new(&tets.mesh, quadratic);
    // Planes of nodes that are stretched differently on either side have the middles between them a little off the face.
    let slack = if tets.own { 1e-9 } else { 0.1 } * mesh.length();
    let held =
        tets.held.iter().zip(regions).map(|(nodes, region)| Held { nodes: with_middles(nodes, &mesh, &region, slack), region });
    let clock = match plan.clock.steps {
        0 => Clock::Static,
        steps => Clock::Motion { step: plan.clock.step, steps },
    };
    let moves = physics.velocity.length() + physics.angular_velocity.length() > 0.0;
    let spin = Spin { velocity: physics.velocity, angular: physics.angular_velocity, pivot: plan.pivot };
    let specimen = Specimen {
        name: file_name(&stem(&scene.path)),
        title: scene.title.clone(),
        source: format!("{}, exported by palpate {}", scene.path.display(), env!("CARGO_PKG_VERSION")),
        material: Material {
            model: scene.material.model.name,
            youngs_modulus: physics.youngs_modulus,
            poisson_ratio: physics.poisson_ratio,
            density: physics.density,
            mass_damping: physics.mass_damping,
            stiffness_damping: physics.stiffness_damping,
        },
        moduli,
        densities,
        held: held.collect(),
        mesh,
        planes: planes(plan, &physics)
            .iter()
            .map(|p| Ground { normal: p.normal[0], height: p.height, stiffness: p.stiffness })
            .collect(),
        masses: scene.masses.iter().zip(&physics.masses).map(|(m, mass)| PointMass { point: m.point, mass: *mass }).collect(),
        gravity: physics.gravity,
        start,
        spin: (moves && clock != Clock::Static).then_some(spin),
        clock,
        beyond: beyond(scene),
    };
    Ok((specimen, tets.volume))
}

/// A name of files that every format takes: letters, digits, `-` and `_`, a letter first.
fn file_name(stem: &str) -> String {
    let kept: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '_' }).collect();
    if kept.starts_with(|c: char| c.is_ascii_alphabetic()) { kept } else { format!("body_{kept}") }
}

/// What no format holds: laws beyond the material, and what moves by a path.
fn beyond(scene: &Scene) -> Vec<(String, String)> {
    let effects = scene.effects.iter().enumerate().map(|(i, e)| (format!("effect.{i}"), e.law().kind.to_string()));
    let moving = scene.clamps.iter().enumerate().filter(|(_, c)| c.motion.is_some());
    let motions = moving.map(|(i, _)| (format!("clamp.{i}.motion"), "it is held still".to_string()));
    let handles = scene.synthesis.handles.iter().enumerate().map(|(i, _)| (format!("handle.{i}"), "a pull".to_string()));
    let viscosity = scene.material.viscosity.map(|_| ("material.viscosity".to_string(), "a law of rates".to_string()));
    let curved = scene.curves.stretch.factors.len() + scene.curves.volume.factors.len() > 0;
    let curves = curved.then(|| ("material.stretch_curve and volume_curve".to_string(), "factors of stretches".to_string()));
    effects.chain(motions).chain(handles).chain(viscosity).chain(curves).collect()
}

/// What each clamp holds, as a box in the world.
fn regions(scene: &Scene, plan: &Plan) -> Vec<ClipBox> {
    let of = |(clamp, site): (&palpate_model::scene::Clamp, &palpate_model::plan::ClampSite)| match &clamp.region {
        ClampRegion::Box { min, max, object_frame } => {
            let to_frame = if *object_frame { scene.object.pose.inverse() } else { DAffine3::IDENTITY };
            ClipBox { to_frame, min: *min, max: *max }
        }
        ClampRegion::Group(_) => {
            let places = || site.nodes.iter().map(|(n, _)| plan.body.nodes[*n as usize]);
            let (min, max) = (places().fold(DVec3::INFINITY, DVec3::min), places().fold(DVec3::NEG_INFINITY, DVec3::max));
            ClipBox { to_frame: DAffine3::IDENTITY, min, max }
        }
    };
    scene.clamps.iter().zip(&plan.clamps).map(of).collect()
}

/// The scene's own tetrahedra, or those that its shape is filled with.
fn tetrahedra(e: &Experiment, regions: &[ClipBox], options: &ExportOptions) -> Result<Tets, Error> {
    let (scene, plan) = (e.scene(), e.plan());
    let own = match (&scene.object.source, scene.object.resolution) {
        (BodySource::Tetrahedra { mesh, .. }, _) => Some(mesh.transformed(&scene.object.pose)),
        (_, Resolution::Edge(_)) => Some(made(&scene.object).map_err(|e| Error::Failed(e.to_string()))?.0),
        _ => None,
    };
    if let Some(mesh) = own {
        if let Some(edge) = options.edge_length {
            return Err(Error::option("edge-length", edge, "the body has tetrahedra of its own, which are written as they are"));
        }
        let corner = |n: &u32| (*n as usize) < mesh.nodes.len();
        let held = plan.clamps.iter().map(|c| c.nodes.iter().map(|h| h.0).filter(corner).collect()).collect();
        return Ok(Tets { held, volume: plan.body.volume, mesh, own: true });
    }
    let edge = options.edge_length.unwrap_or(plan.body.length);
    // In the shape's own frame, where its faces lie along the lattice and the mesh does not depend on the pose.
    let shape = shape_of(&Object { pose: DAffine3::IDENTITY, ..scene.object.clone() });
    let clamps: Vec<ClipBox> = regions.iter().map(|r| in_frame(r, &scene.object.pose)).collect();
    let filled = fill(shape.as_ref(), &clamps, edge);
    let Filled { mesh, held, volume, .. } = filled.map_err(|e| Error::option("edge-length", edge, e.to_string()))?;
    if let Some(i) = held.iter().position(Vec::is_empty) {
        let message = format!("clamp.{i} holds no node of tetrahedra with such edges; give a smaller one");
        return Err(Error::option("edge-length", edge, message));
    }
    Ok(Tets { mesh: mesh.transformed(&scene.object.pose), held, volume, own: false })
}

/// Held corners, and the middles of edges between two of them or within the region, which a face may pass by so far [m].
fn with_middles(corners: &[u32], mesh: &Mesh, region: &ClipBox, slack: f64) -> Vec<u32> {
    let is_held = |n: u32| corners.binary_search(&n).is_ok();
    let inside = |n: u32| region.distances(mesh.nodes[n as usize]).iter().all(|d| *d <= slack);
    let mut all = corners.to_vec();
    for (t, middles) in mesh.tets.iter().zip(&mesh.middles) {
        for ([a, b], m) in EDGES.iter().zip(middles) {
            if is_held(t[*a]) && is_held(t[*b]) || inside(*m) {
                all.push(*m);
            }
        }
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// The product of all fields on a number at its places, where there are some.
fn product(plan: &Plan, physics: &Physics, varied: Varied) -> Option<Vec<f64>> {
    let mut own = plan.fields.iter().zip(&physics.fields).filter(|(f, _)| f.varied == varied).map(|(f, v)| f.factors(v));
    let first = own.next()?;
    Some(own.fold(first, |all, f| all.iter().zip(f).map(|(a, b)| a * b).collect()))
}

/// Middle of every tetrahedron [m].
fn middles(mesh: &TetMesh) -> impl Iterator<Item = DVec3> + '_ {
    mesh.tets.iter().map(|t| t.iter().map(|n| mesh.nodes[*n as usize]).sum::<DVec3>() * 0.25)
}

/// Young's modulus of every tetrahedron [Pa], where it varies: that of the element there.
fn moduli(plan: &Plan, physics: &Physics, tets: &Tets) -> Option<Vec<f64>> {
    let factors = product(plan, physics, Varied::Modulus)?;
    let scaled = |e: usize| physics.youngs_modulus * factors[e];
    if tets.own {
        return Some((0..factors.len()).map(scaled).collect());
    }
    let places: Vec<DVec3> = plan.body.middles().collect();
    let near = Near::new(&places, plan.body.length);
    Some(middles(&tets.mesh).map(|x| scaled(near.find(&places, x))).collect())
}

/// Density of every tetrahedron [kg/m³], where it varies: what the simulation's nodes make of it at its middle.
fn densities(plan: &Plan, physics: &Physics, tets: &Tets) -> Option<Vec<f64>> {
    let factors = product(plan, physics, Varied::Density)?;
    let carrier = plan.body.carrier();
    let at = |x: DVec3| {
        let s = carrier.carry(x).0;
        let blended = s.nodes.iter().zip(&s.value).map(|(n, w)| w * factors[*n as usize]).sum::<f64>();
        // Outside every element the field is continued, and a continuation may pass zero.
        let least = s.nodes.iter().map(|n| factors[*n as usize]).fold(f64::INFINITY, f64::min);
        physics.density * blended.max(least)
    };
    Some(middles(&tets.mesh).map(at).collect())
}

/// Places in cubes, so that the nearest is found among few.
struct Near {
    edge: f64,
    cubes: HashMap<[i64; 3], Vec<usize>>,
}

impl Near {
    fn new(places: &[DVec3], edge: f64) -> Near {
        let mut near = Near { edge, cubes: HashMap::new() };
        for (i, x) in places.iter().enumerate() {
            near.cubes.entry(near.cube(*x)).or_default().push(i);
        }
        near
    }

    fn cube(&self, x: DVec3) -> [i64; 3] {
        (x / self.edge).floor().as_i64vec3().to_array()
    }

    /// The nearest place, of those in cubes around; where these are empty, of all.
    fn find(&self, places: &[DVec3], x: DVec3) -> usize {
        let [a, b, c] = self.cube(x);
        let around = (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [a + i, b + j, c + k])));
        let mut some: Vec<usize> = around.filter_map(|cube| self.cubes.get(&cube)).flatten().copied().collect();
        if some.is_empty() {
            some = (0..places.len()).collect();
        }
        let far = |i: usize| places[i].distance_squared(x);
        some.into_iter().min_by(|i, j| far(*i).total_cmp(&far(*j)).then(i.cmp(j))).unwrap_or(0)
    }
}

/// Rounds in which a place of the shape at the start is found for one of the stress-free shape.
const ROUNDS: usize = 200;

/// The shape at the start, where it differs from the stress-free one; where the scene gives the loaded shape, the mesh is moved to the
/// stress-free one.
fn start<'a>(e: &'a Experiment, tets: &mut Tets) -> Result<Option<Displacement<'a>>, Error> {
    let plan = e.plan();
    let still = plan.clock.steps == 0;
    match plan.initial {
        InitialShape::Rest => Ok(None),
        // A static problem is what the other program is to solve.
        InitialShape::StaticEquilibrium if still => Ok(None),
        InitialShape::StaticEquilibrium => {
            let u = first_state(plan)?.displacement;
            let carrier = plan.body.carrier();
            Ok(Some(Arc::new(move |x| carrier.carry(x).0.get().at(&u))))
        }
        InitialShape::Given => {
            let w = CpuBackend.stress_free(plan, &plan.theta)?;
            let carrier = plan.body.carrier();
            let to_free = move |x: DVec3| carrier.carry(x).0.get().at(&w);
            let nodes: Vec<DVec3> = tets.mesh.nodes.iter().map(|x| *x + to_free(*x)).collect();
            let size = plan.body.size();
            let back = move |free: DVec3| {
                let mut x = free;
                for _ in 0..ROUNDS {
                    let next = free - to_free(x);
                    let done = (next - x).length() < 1e-12 * size;
                    x = next;
                    if done {
                        break;
                    }
                }
                x - free
            };
            // What the rounds leave open is told, not passed on.
            let worst =
                tets.mesh.nodes.iter().zip(&nodes).map(|(x, free)| (*free + back(*free) - *x).length()).fold(0.0, f64::max);
            tets.mesh.nodes = nodes;
            let sound = tets.mesh.tets.iter().all(|t| {
                let [a, b, c, d] = t.map(|n| tets.mesh.nodes[n as usize]);
                (b - a).cross(c - a).dot(d - a) > 0.0
            });
            if !sound {
                return Err(e.fault("object.state", "has a stress-free shape in which tetrahedra are turned inside out"));
            }
            if still {
                return Ok(None);
            }
            if worst > 1e-6 * size {
                return Err(e.fault("object.state", "is too far from its stress-free shape: places in it are not found again"));
            }
            Ok(Some(Arc::new(back)))
        }
    }
}

/// The state that a motion begins with.
fn first_state(plan: &Plan) -> Result<Snapshot, Error> {
    let mut first = None;
    Backend::Cpu.visit(plan, &plan.theta, |_, s, _| {
        first = Some(s);
        ControlFlow::Break(())
    })?;
    first.ok_or_else(|| Error::Failed("the simulation has no state at the start".into()))
}
