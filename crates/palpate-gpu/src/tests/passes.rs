//! The passes of a step one by one, at one given state, against the same quantities of the CPU; each comparison must see one percent.

use super::majorised::ask;
use super::products::crowded;
use super::scenes::{device, plan, solving_part};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::{asks, solving::EVEN_WAY, solving::IMAGE};
use crate::passes::{ALL, Passes, Per};
use crate::world::{SOLVING, State, World};
use crate::{GpuBackend, Product};
use glam::{DMat3, DVec3};
use palpate_cpu::linear::matrix::Matrix;
use palpate_cpu::terms::altered::Altered;
use palpate_cpu::terms::consistent::mass_matrix;
use palpate_cpu::terms::elastic_cells::corners;
use palpate_cpu::terms::{Context, Curvature, Equation, Past, Rates, Weights, acting};
use palpate_engine::{Backend, ParamBatch, Request};
use palpate_model::cutcells::corotation::{CellPose, multiply};
use palpate_model::cutcells::elements::{Classes, Elements};
use palpate_model::effects::{self, Effect};
use palpate_model::mechanics::plane::planes;
use palpate_model::params::ParamKey;
use palpate_model::params::coefficients::Coefficients;
use palpate_model::plan::{Physics, Plan};
use palpate_model::scene::Scene;
use palpate_model::space::pattern::{Pattern, Places};
use std::sync::OnceLock;

/// What one pass computed: its name, numbers, and the part of the largest number that may differ.
pub(super) type Part = (&'static str, Vec<f64>, f64);

/// Old displacement [m] and velocity [m/s], and the increment beyond free flight [m], at a node.
pub(super) type Given = fn(DVec3) -> [DVec3; 3];

// Displacements have 24 bits of the increment and of the flight alone. Forces of cells are sums of products with strains of some
// percent, each with an error of 6e-8 of the edge: 1e-6 of the force, times the bulk modulus over the shear modulus. Matrices and
// products are sums of terms of both signs with 24 bits each. Solves end at 2e-7 in the preconditioner's norm, from where the
// recursive residual of single precision drifts. Energies nearly cancel between two trials.
const PLACED: f64 = 3e-7;
pub(super) const FORCES: f64 = 5e-6;
const MATRIX: f64 = 2e-6;
const SOLVED: f64 = 3e-5;
const ENERGY: f64 = 1e-4;

/// Turned, stretched, waved.
pub(super) fn given(x: DVec3) -> [DVec3; 3] {
    let wave = |f: f64| DVec3::new((f * x.y).sin(), (f * x.z + 1.0).cos(), (f * (x.x + x.y)).sin());
    let turn = DMat3::from_rotation_y(0.2);
    let old = turn * (x * DVec3::new(1.04, 0.97, 1.0)) - x + 1e-3 * wave(40.0);
    [old, 0.3 * wave(25.0), 8e-4 * wave(60.0)]
}

/// The right-hand side that is solved for [N], large and small alike in the preconditioner's norm.
pub(super) fn load(plan: &Plan) -> Vec<DVec3> {
    plan.body.nodes.iter().zip(&plan.body.node_volume).map(|(x, v)| 1e4 * *v * given(*x)[1]).collect()
}

pub(super) fn single(v: &DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

pub(super) fn flat<'a>(v: impl IntoIterator<Item = &'a DVec3>) -> Vec<f64> {
    v.into_iter().flat_map(|v| v.to_array()).collect()
}

pub(super) fn three(v: &[[f32; 4]]) -> Vec<f64> {
    v.iter().flat_map(|v| [v[0], v[1], v[2]]).map(f64::from).collect()
}

pub(super) fn vectors(v: &[[f32; 4]]) -> Vec<DVec3> {
    v.iter().map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect()
}

/// True for a body of cells without effects, of the linear material.
fn without_effects(plan: &Plan) -> bool {
    plan.body.points.is_empty() && plan.model.is_linear && plan.layout.effects().next().is_none()
}

/// A world at the plan's own values that takes one iteration of Newton's method at a time.
pub(super) fn stepwise(backend: &GpuBackend, plan: &Plan) -> World {
    let mut world = backend.build(plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    world.set_iterations(1);
    world
}

/// The device's numbers, with A of the CPU to check solutions by.
pub(super) fn found(backend: &GpuBackend, plan: &Plan, right: &Exact) -> Vec<Part> {
    let (world, n) = (&stepwise(backend, plan), plan.body.nodes.len());
    let tally = backend.new_tally(world, &Request::default());
    let (now, next) = (backend.new_state(world), backend.new_state(world));
    let quantum = f64::from(world.geometry.shape.quantum);
    let all: Vec<[DVec3; 3]> = plan.body.nodes.iter().map(|x| (right.given)(*x)).collect();
    let mut old = vec![[0.0f32; 4]; 3 * n];
    for (i, [u, v, _]) in all.iter().enumerate() {
        let whole = (*u / quantum).round() * quantum;
        for (k, part) in [whole, *u - whole, *v].iter().enumerate() {
            old[k * n + i] = single(part);
        }
    }
    world.gpu.queue.write_buffer(&now.0.buffer, 0, bytemuck::cast_slice(&old));
    step(world, &now, &next, &tally, |s| {
        s.list();
        s.prepare();
        s.run(pass::PREDICT, ALL, Per::Node, 0);
    });
    let get = |name: &str, items: usize| -> Vec<[f32; 4]> {
        world.gpu.download(&world.buffers[name], items).unwrap_or_else(|e| panic!("{e}"))
    };
    let trial = |length: f64| {
        let w: Vec<[f32; 4]> = all.iter().map(|a| single(&(length * a[2]))).collect();
        world.gpu.queue.write_buffer(&world.buffers["increment"], 0, bytemuck::cast_slice(&w));
        step(world, &now, &next, &tally, |s| {
            s.run(pass::PLACE_NEXT, ALL, Per::Node, 0);
            s.residual(ALL);
        });
        get("residual", n)
    };
    let potential = |r: &[[f32; 4]]| r.iter().map(|v| f64::from(v[3])).sum::<f64>();
    let half = potential(&trial(0.5));
    let residual = trial(1.0);
    let cells = 8 * plan.body.cells().len();
    let forces = if cells == 0 { Vec::new() } else { three(&get("cell_force", cells)) };
    ask(world, right.curvature);
    step(world, &now, &next, &tally, |s| s.assemble(ALL));
    let placed: Vec<[f32; 4]> = world.gpu.download(&next.0.buffer, 2 * n).unwrap_or_else(|e| panic!("{e}"));
    let u1: Vec<DVec3> = vectors(&placed[..n]).iter().zip(vectors(&placed[n..])).map(|(a, b)| *a + b).collect();
    let values: Vec<f32> =
        world.gpu.download(&world.buffers["values"], 9 * right.pattern.blocks.columns.len()).unwrap_or_else(|e| panic!("{e}"));
    let rhs: Vec<[f32; 4]> = load(plan).iter().map(single).collect();
    world.gpu.queue.write_buffer(&world.buffers["rhs"], 0, bytemuck::cast_slice(&rhs));
    let inverses = get("inverses", 2 * n);
    let jacobi: Vec<DVec3> = inverses.chunks(2).zip(load(plan)).map(|(own, r)| scaled(own, r)).collect();
    step(world, &now, &next, &tally, |s| {
        s.begin_column(0);
        s.list();
        s.begin_cg(asks::FOR_DERIVATIVE);
        s.precondition();
        s.multiply(Product::Matrix, 0);
    });
    let (along, image) = (vectors(&solving_part(world, EVEN_WAY)), solving_part(world, IMAGE));
    // Without a matrix nothing knows of what effects add to it.
    let free = without_effects(plan).then(|| {
        step(world, &now, &next, &tally, |s| {
            s.multiply(Product::Free, 0);
        });
        ("multiply_cells", right.off_product(&along, &vectors(&solving_part(world, IMAGE))), MATRIX)
    });
    step(world, &now, &next, &tally, |s| s.solve());
    let solution = vectors(&get(SOLVING, n));
    let parts = vec![
        ("place_next", flat(&u1), PLACED),
        ("press_cells", forces, FORCES),
        ("touch_patches and hold_cells", three(&get("residual", 3 * n)[2 * n..]), FORCES),
        ("gather_residual", three(&residual), FORCES),
        ("energies", vec![potential(&residual) - half], ENERGY),
        ("gather_matrix", values.iter().map(|v| f64::from(*v)).collect(), MATRIX),
        ("invert_diagonal", flat(&jacobi), FORCES),
        ("multiply_rows", right.off_product(&along, &vectors(&image)), MATRIX),
        ("iterate_cg", flat(&right.scaled(&right.product(&solution))), SOLVED),
    ];
    parts.into_iter().chain(free).collect()
}

/// What a node's own inverse block makes of a force.
fn scaled(inverse: &[[f32; 4]], r: DVec3) -> DVec3 {
    let [a, b] = [inverse[0], inverse[1]].map(|v| v.map(f64::from));
    glam::DMat3::from_cols_array(&[a[0], a[1], a[2], a[1], a[3], b[0], a[2], b[0], b[1]]) * r
}

fn step(world: &World, now: &State, next: &State, tally: &crate::Tally, work: impl FnOnce(&mut Passes)) {
    world.record(|r| work(&mut Passes::new(world, r, Some(0), now, next, tally)));
}

/// The CPU's numbers, and its matrix.
pub(super) struct Exact {
    given: Given,
    curvature: Curvature,
    pattern: Pattern,
    matrix: Matrix,
    parts: Vec<(&'static str, Vec<f64>)>,
}

/// Runs `work` with what the CPU's terms of a step read, and the new displacement, at given nodes.
pub(super) fn with_context<T>(plan: &Plan, given: Given, work: impl for<'a> FnOnce(Context<'a>, &'a [DVec3]) -> T) -> T {
    let coefficients = Coefficients::new(plan, &plan.theta);
    let physics = &coefficients.physics;
    let of = |ratio: f64| Elements::new(plan, &Classes::new(plan), ratio);
    let (elements, strains) = (of(physics.poisson_ratio), plan.layout.is_viscous().then(|| of(0.0)));
    let pattern = Pattern::of(plan);
    let places = Places::new(plan, &pattern);
    let altered = Altered::new(plan, &coefficients, &elements);
    let masses = mass_matrix(plan, &pattern, &places, &coefficients);
    let effects = acting(plan, physics);
    let planes = planes(plan, physics);
    let (dt, theta) = (plan.clock.step, plan.clock.theta);
    let (u0, v0): (Vec<DVec3>, Vec<DVec3>) = plan.body.nodes.iter().map(|x| (given(*x)[0], given(*x)[1])).unzip();
    let springs = OnceLock::new();
    let context = Context {
        plan,
        pattern: &pattern,
        places: &places,
        elements: &elements,
        strains: strains.as_ref(),
        coefficients: &coefficients,
        masses: &masses,
        springs: &springs,
        planes: &planes,
        effects: &effects,
        altered: &altered,
        inertia: Some(Rates { displacement: 1.0 / (theta * dt * dt), velocity: 1.0 / (theta * dt), rate: 1.0 / dt }),
        weights: Weights { new: theta, old: 1.0 - theta, rate: physics.stiffness_damping / dt },
        time: physics.start + dt,
        past: Past { u: &u0, v: &v0, each: &[(1.0, &u0)], lag: None },
    };
    let u1 = placed(&context, given, 1.0);
    work(context, &u1)
}

/// Free flight, and a part of the increment beyond it.
fn placed(c: &Context, given: Given, length: f64) -> Vec<DVec3> {
    let (plan, dt) = (c.plan, c.plan.clock.step);
    let flight = |[u, v, w]: [DVec3; 3]| u + dt * v + plan.clock.theta * dt * dt * c.physics().gravity + length * w;
    plan.body.nodes.iter().map(|x| flight(given(*x))).collect()
}

impl Exact {
    pub(super) fn new(plan: &Plan, given: Given) -> Exact {
        Exact::curved(plan, given, Curvature::Exact)
    }

    /// The same with tangents of another curvature.
    pub(super) fn curved(plan: &Plan, given: Given, curvature: Curvature) -> Exact {
        with_context(plan, given, |c, u1| Exact::of(c, u1, given, curvature))
    }

    fn of(c: Context, u1: &[DVec3], given: Given, curvature: Curvature) -> Exact {
        let Context { plan, elements, altered, weights, .. } = c;
        let physics = c.physics();
        let u_half = placed(&c, given, 0.5);
        // Supports of the new state: what clamps, planes and effects add to a residual without the old state's forces.
        let bare = Plan { clamps: Vec::new(), ..plan.clone() };
        let fresh = Context { weights: Weights { old: 0.0, ..weights }, ..c };
        let free = Context { plan: &bare, planes: &[], effects: &[], ..fresh };
        let residual = |c: Context| Equation::new(c).residual(u1);
        let supports: Vec<f64> = residual(fresh).iter().zip(residual(free)).flat_map(|(a, b)| (*a - b).to_array()).collect();
        let (body, h) = (&plan.body, plan.body.length);
        let mut cells = Vec::new();
        for e in 0..body.cells().len() {
            let mut poses = [u1, c.past.u].map(|u| CellPose::new(&corners(body, e, u), h));
            if let Some(rest) = &altered.rest {
                poses.iter_mut().for_each(|p| p.q.iter_mut().zip(&rest[e].q).for_each(|(q, w)| *q -= w));
            }
            let k = &elements.cell(e).k;
            let (a, b) = (multiply(k, &poses[0].q), multiply(k, &poses[1].q));
            let y = std::array::from_fn(|i| physics.youngs_modulus * ((weights.new + weights.rate) * a[i] - weights.rate * b[i]));
            let mut force = flat(&poses[0].force(&y));
            if let Some(guard) = poses[0].guard() {
                let unit = weights.new * physics.youngs_modulus * body.cells()[e].fraction * h.powi(3);
                force.iter_mut().zip(flat(&guard.force())).for_each(|(f, g)| *f += unit * g);
            }
            cells.extend(force);
        }
        let mut whole = Equation::new(c);
        let residual = flat(&whole.residual(u1));
        let energy = whole.potential(u1) - whole.potential(&u_half);
        let (mut light, mut matrix) = (Matrix::default(), Matrix::default());
        // On the device inertia is kept out of the matrix.
        let mut weightless = Equation::new(Context { inertia: c.inertia.map(|t| Rates { displacement: 0.0, ..t }), ..c });
        weightless.residual(u1);
        weightless.tangent(u1, curvature, &mut light);
        whole.tangent(u1, curvature, &mut matrix);
        // Rows of blocks, as the device keeps them.
        let values = light.values.iter().flat_map(|b| b.transpose().to_cols_array()).collect();
        let mut exact = Exact { given, curvature, pattern: Pattern::of(plan), matrix, parts: Vec::new() };
        let load = exact.scaled(&load(plan));
        exact.parts = vec![
            ("place_next", flat(u1)),
            ("press_cells", cells),
            ("touch_patches and hold_cells", supports),
            ("gather_residual", residual),
            ("energies", vec![energy]),
            ("gather_matrix", values),
            ("invert_diagonal", flat(&load)),
            ("multiply_rows", vec![0.0, 1.0]),
            ("iterate_cg", flat(&load)),
        ];
        exact.parts.extend(without_effects(plan).then(|| ("multiply_cells", vec![0.0, 1.0])));
        exact
    }

    /// A x.
    pub(super) fn product(&self, x: &[DVec3]) -> Vec<DVec3> {
        let b = &self.pattern.blocks;
        (0..x.len()).map(|a| (b.rows[a]..b.rows[a + 1]).map(|k| self.matrix.values[k] * x[b.columns[k] as usize]).sum()).collect()
    }

    /// D⁻¹ r, D the diagonal blocks.
    pub(super) fn scaled(&self, r: &[DVec3]) -> Vec<DVec3> {
        r.iter().zip(&self.pattern.blocks.diagonal).map(|(r, d)| self.matrix.values[*d].inverse() * *r).collect()
    }

    /// Largest error of a product over its largest number, beside one: the vector was the device's own.
    fn off_product(&self, x: &[DVec3], y: &[DVec3]) -> Vec<f64> {
        let right = self.product(x);
        let size = right.iter().map(|v| v.length()).fold(0.0, f64::max);
        vec![right.iter().zip(y).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max) / size, 1.0]
    }
}

/// Passes that differ by more than they may.
pub(super) fn apart(found: &[Part], right: &Exact) -> Vec<&'static str> {
    let mut out = Vec::new();
    for ((name, a, allowed), (other, b)) in found.iter().zip(&right.parts) {
        assert_eq!((name, a.len()), (other, b.len()));
        let size = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let off = a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, |m: f64, d| if d > m || d.is_nan() { d } else { m });
        print!("{name} {:.1e}; ", off / size);
        if off.is_nan() || off > allowed * size {
            out.push(*name);
        }
    }
    println!();
    out
}

/// Everything acts: clamps that move, two planes, a point mass, ghosts, both dampings, effects on nodes, patches, cells and clamps.
pub(super) fn scene() -> Scene {
    let mut s = crowded();
    s.material.mass_damping = 5.0;
    s.material.stiffness_damping = 0.004;
    s.masses.iter_mut().for_each(|m| m.mass = 0.1);
    s.planes[0].stiffness = Some(3e5);
    for (kind, value) in
        [("coulomb-friction", 0.5), ("uniform-force", 5000.0), ("stiffness-gradient", 5.0), ("density-gradient", 6.0)]
            .into_iter()
            .chain([("rest-shape", 0.04), ("compliant-clamp", 0.004), ("clamp-slip", 0.002)])
    {
        let mut effect = Effect::absent(effects::find(kind).unwrap_or_else(|| panic!("{kind}")));
        effect.values[0] = Some(value);
        s.effects.push(effect);
    }
    s
}

/// Laws of cells, strong beside the material.
pub(super) fn lawful() -> Scene {
    let mut s = crowded();
    for (kind, value) in
        [("strain-stiffening", 60.0), ("transverse-anisotropy", 2.0), ("power-law-viscosity", 0.2), ("structural-damping", 1.0)]
    {
        let mut effect = Effect::absent(effects::find(kind).unwrap_or_else(|| panic!("{kind}")));
        effect.values[0] = Some(value);
        s.effects.push(effect);
    }
    s
}

fn scale(plan: &mut Plan, key: ParamKey) {
    let place = plan.layout.index(key);
    plan.theta[place] *= 1.01;
}

/// A fault of one percent, and the passes that must show it.
type Fault = (&'static str, fn(&mut Plan), &'static [&'static str]);

const FAULTS: [Fault; 9] = [
    ("gravity", |p| scale(p, ParamKey::Gravity(2)), &["place_next"]),
    (
        "Young's modulus",
        |p| scale(p, ParamKey::YoungsModulus),
        &[
            "press_cells",
            "touch_patches and hold_cells",
            "gather_residual",
            "energies",
            "gather_matrix",
            "multiply_rows",
            "iterate_cg",
        ],
    ),
    ("Poisson's ratio", |p| scale(p, ParamKey::PoissonRatio), &["press_cells", "gather_residual", "gather_matrix"]),
    ("density", |p| scale(p, ParamKey::Density), &["gather_residual", "invert_diagonal", "multiply_rows", "iterate_cg"]),
    ("mass damping", |p| scale(p, ParamKey::MassDamping), &["gather_matrix"]),
    ("stiffness damping", |p| scale(p, ParamKey::StiffnessDamping), &["press_cells", "gather_matrix"]),
    ("ghost penalty", |p| p.solver.ghost *= 1.01, &["gather_residual", "gather_matrix"]),
    (
        "contact",
        |p| p.planes.iter_mut().for_each(|q| q.stiffness = q.stiffness.map(|s| 1.01 * s)),
        &["touch_patches and hold_cells"],
    ),
    ("point mass", |p| scale(p, ParamKey::PointMass(0)), &["multiply_rows", "iterate_cg"]),
];

#[test]
fn passes_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plan = plan(&scene());
    let mut right = Exact::new(&plan, given);
    // Stiffness varies over the body: the CPU's cells by themselves were computed without.
    let factors = palpate_model::params::changes::Changes::new(&plan, &Physics::new(&plan.layout, &plan.theta)).modulus;
    if let Some(factors) = factors {
        for (f, factor) in right.parts[1].1.chunks_exact_mut(24).zip(factors) {
            f.iter_mut().for_each(|f| *f *= factor);
        }
    }
    assert_eq!(apart(&found(&backend, &plan, &right), &right), [""; 0]);
    for (name, fault, passes) in FAULTS {
        let mut wrong = plan.clone();
        fault(&mut wrong);
        print!("{name}: ");
        let seen = apart(&found(&backend, &wrong, &right), &right);
        for pass in passes {
            assert!(seen.contains(pass), "1 % of {name} is not seen in {pass}, only in {seen:?}");
        }
    }
    // Effects: any of the forces.
    for (place, key) in plan.layout.keys.iter().enumerate() {
        if let ParamKey::Effect { slot: 0, .. } = key {
            let mut wrong = plan.clone();
            wrong.theta[place] *= 1.01;
            assert!(!apart(&found(&backend, &wrong, &right), &right).is_empty(), "1 % of {} is not seen", key.spec().path);
        }
    }
}

#[test]
fn passes_with_laws_of_cells_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plan = plan(&lawful());
    let right = Exact::new(&plan, given);
    // The CPU's cells by themselves were computed without laws.
    let others = |plan: &Plan| -> Vec<&str> {
        apart(&found(&backend, plan, &right), &right).into_iter().filter(|p| *p != "press_cells").collect()
    };
    assert_eq!(others(&plan), [""; 0]);
    for (place, key) in plan.layout.keys.iter().enumerate() {
        if let ParamKey::Effect { slot: 0, .. } = key {
            let mut wrong = plan.clone();
            wrong.theta[place] *= 1.01;
            print!("{}: ", key.spec().path);
            let seen = others(&wrong);
            for pass in ["gather_residual", "gather_matrix", "multiply_rows"] {
                assert!(seen.contains(&pass), "1 % of {} is not seen in {pass}, only in {seen:?}", key.spec().path);
            }
        }
    }
}
