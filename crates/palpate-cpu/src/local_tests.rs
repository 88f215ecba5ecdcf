//! Every local derivative of the terms by itself, at random states: against central differences, and transposes against
//! products.

use crate::linear::matrix::{Operator, Packed};
use crate::local_bodies::{Made, altering, ball, cloud, curved, fields, flowing, leading, plan, tetrahedra};
use crate::simulate::{self, Start};
use crate::terms::elastic_cells::corners;
use crate::terms::{Curvature, PastChange, zeros};
use crate::world::{Gradient, MemberState, World};
use glam::DVec3;
use palpate_engine::{Direction, ParamBatch};
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::effects::{Effect, Site, find};
use palpate_model::materials;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Basis, FieldSpec};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::{self, Stage};
use palpate_model::scene::*;
use std::cell::{Cell, RefCell};

/// Random vectors in a cube of half edge `size`, reproducible.
fn random(n: usize, size: f64, seed: u64) -> Vec<DVec3> {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        size * (2.0 * (s >> 11) as f64 / (1u64 << 53) as f64 - 1.0)
    };
    (0..n).map(|_| DVec3::new(next(), next(), next())).collect()
}

pub(crate) fn world(plan: &Plan, theta: &[f64]) -> World {
    let mut w = World::new(plan);
    w.set_params(&ParamBatch::from_rows(&[theta.to_vec()]));
    w
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Largest difference over the largest entry.
fn off(a: &[DVec3], b: &[DVec3]) -> f64 {
    let size = b.iter().map(|v| v.length()).fold(1e-30, f64::max);
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max) / size
}

fn moved(v: &[DVec3], s: f64, d: &[DVec3]) -> Vec<DVec3> {
    v.iter().zip(d).map(|(v, d)| *v + s * *d).collect()
}

/// A displacement that turns the body inside out: z mirrored and shortened a little, and noise.
fn inverted(p: &Plan) -> Vec<DVec3> {
    let mirror = |(u, x): (DVec3, &DVec3)| u - DVec3::Z * (1.75 * (x.z - 0.045));
    random(p.body.nodes.len(), 0.003, 3).into_iter().zip(&p.body.nodes).map(mirror).collect()
}

/// A state to check at: the stage (`None` = static), the new displacement and the past states.
struct At<'a> {
    /// Number of the state.
    seed: u64,
    plan: &'a Plan,
    /// Of the plan; made once, as patterns and tables of a body take longer than its forces.
    world: &'a RefCell<World>,
    stage: Option<&'a Stage>,
    u1: &'a [DVec3],
    past: Vec<MemberState>,
}

impl At<'_> {
    /// Runs `f` on the equation of parameters `theta`, with other past states.
    fn with<T>(&self, theta: &[f64], past: &[MemberState], f: impl FnOnce(crate::terms::Equation) -> T) -> T {
        let mut w = self.world.borrow_mut();
        if w.members.first().is_none_or(|m| m.theta != theta) {
            w.set_params(&ParamBatch::from_rows(&[theta.to_vec()]));
        }
        let n = self.u1.len();
        let still =
            Stage { number: 0, step: 0, from: Vec::new(), length: 1.0, theta: 1.0, time: 0.0, completes: None, still: false };
        let blank = [MemberState { u: zeros(n), v: zeros(n) }];
        let start = match self.stage {
            Some(stage) => Start::new(stage, &past.iter().collect::<Vec<_>>()),
            None => Start::new(&Stage { from: vec![(0, 1.0)], ..still }, &[&blank[0]]),
        };
        f(simulate::equation(&w.shared, &w.members[0], self.stage, &start))
    }

    fn residual(&self, u1: &[DVec3], past: &[MemberState]) -> Vec<DVec3> {
        self.with(&self.plan.theta, past, |mut e| e.residual(u1))
    }
}

/// Runs a check for the static problem, for a step of the θ-scheme and for one from two past states, without effects and with all that
/// change the body, at three states each.
fn everywhere(check: impl Fn(&At)) {
    let models = materials::ALL.iter().map(|model| (model, Vec::new()));
    for (model, effects) in models.chain([(&materials::ALL[0], altering()), (&materials::ALL[1], altering())]) {
        check_all(Plan { model, ..plan(effects) }, &check);
    }
    // Laws that follow paths, have a course in time or turn with the surface.
    check_all(plan(leading()), &check);
    check_all(Made::of(tetrahedra(1), leading()).plan(), &check);
    // A material of curves, and a viscosity, each beside a law of cells that dissipates and a stress-free shape of its own.
    let few = || -> Vec<Effect> {
        altering().into_iter().filter(|e| ["structural-damping", "rest-shape"].contains(&e.law().kind)).collect()
    };
    check_all(curved(ball(), few()), &check);
    check_all(curved(tetrahedra(1), Vec::new()), &check);
    check_all(flowing(ball(), 0.6, few()), &check);
    // Bodies of tetrahedra, with a law at points, and fields of the first material; half of them flow.
    for (model, exponent) in materials::ALL.iter().zip([None, Some(0.6)].into_iter().cycle()) {
        for (kind, count) in [(Tetrahedron::Linear, 2), (Tetrahedron::Quadratic, 1)] {
            let mut drag = Effect::absent(find("air-drag").unwrap());
            drag.values[0] = Some(5.0);
            let fields = if model.is_linear { fields() } else { Vec::new() };
            let viscosity = exponent.map(|exponent| Viscosity { coefficient: 40.0, exponent });
            let made = Made { tetrahedron: kind, fields, viscosity, ..Made::of(tetrahedra(count), vec![drag]) };
            let mut p = Plan { model, ..made.plan() };
            let of_field = |k: &ParamKey| matches!(k, ParamKey::Field { .. });
            let values = p.theta.iter_mut().zip(&p.layout.keys).filter(|(_, k)| of_field(k));
            values.enumerate().for_each(|(i, (v, _))| *v = 1.0 + 0.3 * (i as f64).sin());
            check_all(p, &check);
        }
    }
    // Points of a cloud with their penalty: fields where the material has them, and a viscosity beside a law at points.
    for (model, exponent) in materials::ALL.iter().zip([None, Some(0.6)].into_iter().cycle()) {
        let mut drag = Effect::absent(find("air-drag").unwrap());
        drag.values[0] = Some(5.0);
        let by_points = |f: FieldSpec| FieldSpec { basis: Basis::Points, ..f };
        let fields = if model.is_linear { fields().into_iter().map(by_points).collect() } else { Vec::new() };
        let viscosity = exponent.map(|exponent| Viscosity { coefficient: 40.0, exponent });
        let made = Made { fields, viscosity, ..Made::of(cloud(3), vec![drag]) };
        check_all(Plan { model, ..made.plan() }, &check);
    }
    // Laws of cells, of the clamps and of the body on them.
    for (model, kind, count) in [(&materials::ALL[0], Tetrahedron::Quadratic, 1), (&materials::ALL[1], Tetrahedron::Linear, 2)] {
        let on_tets = |e: &Effect| !matches!(e.law().site, Site::Edges(_));
        let effects = altering().into_iter().filter(on_tets).collect();
        let viscosity = Some(Viscosity { coefficient: 40.0, exponent: 0.6 });
        let made = Made { tetrahedron: kind, viscosity, ..Made::of(tetrahedra(count), effects) };
        check_all(Plan { model, ..made.plan() }, &check);
    }
}

fn check_all(p: Plan, check: &impl Fn(&At)) {
    {
        let (model, n) = (p.model, p.body.nodes.len());
        let world = RefCell::new(World::new(&p));
        let theta = p.clock.stages().swap_remove(1);
        let two = scheme::find("bdf2").unwrap().stages(p.clock.step, 3, p.clock.theta).swap_remove(2);
        for stage in [None, Some(&theta), Some(&two)] {
            // Strains of some 10 % or cells turned inside out, contact active, the old states elsewhere, fast.
            let states = [(1, random(n, 0.003, 1)), (2, random(n, 0.003, 2)), (3, inverted(&p))];
            // Materials with a barrier do not exist inside out.
            let few = model.name.starts_with("neo-hookean") || model.has_curves || !p.body.points.is_empty();
            let exist = if few { 2 } else { 3 };
            for (seed, u) in states.into_iter().take(exist) {
                let state = |s| MemberState { u: random(n, 0.003, seed + s), v: random(n, 0.3, seed + s + 10) };
                let past = stage.map_or(Vec::new(), |s| (0..s.from.len() as u64).map(|i| state(10 + 40 * i)).collect());
                check(&At { seed, plan: &p, world: &world, stage, u1: &u, past });
            }
        }
    }
}

/// A5 of Real2Sim's acceptance: whatever the scheme, a body that turns and moves rigidly meets no viscosity.
#[test]
fn rigid_motion_meets_no_viscosity() {
    for source in [ball(), tetrahedra(2)] {
        let p = flowing(source, 0.8, Vec::new());
        let (n, world) = (p.body.nodes.len(), RefCell::new(World::new(&p)));
        // A fifth of a turn a step.
        let at = |time: f64| -> Vec<DVec3> {
            let turn = glam::DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 120.0 * time);
            p.body.nodes.iter().map(|x| turn * *x + DVec3::new(2.0, 0.1, -0.4) * time - *x).collect()
        };
        for scheme in scheme::ALL {
            for stage in scheme.stages(p.clock.step, 4, 0.55) {
                // Numbers of states are those of the times they stand for, up to the stage itself.
                let count = stage.from.len() as f64;
                let past =
                    (0..stage.from.len()).map(|i| MemberState { u: at(stage.time - 0.01 * (count - i as f64)), v: zeros(n) });
                let (past, u1) = (past.collect::<Vec<_>>(), at(stage.time));
                let place = p.layout.index(ParamKey::Viscosity);
                let force = |coefficient: f64| {
                    let mut theta = p.theta.clone();
                    theta[place] = coefficient;
                    let at = At { seed: 0, plan: &p, world: &world, stage: Some(&stage), u1: &u1, past: past.clone() };
                    at.with(&theta, &past, |mut e| e.residual(&u1))
                };
                let elastic = 5000.0 * p.body.length.powi(2);
                let viscous = force(40.0).iter().zip(force(0.0)).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
                assert!(viscous < 1e-12 * elastic, "{}: {viscous:e} N of {elastic:e}", scheme.name);
            }
        }
    }
}

// Central differences over 1e-6 of a direction of size 1e-3: truncation 1e-12 of the third derivative, rounding 1e-16 / 1e-9.
const STEP: f64 = 1e-4;
const CLOSE: f64 = 2e-7;

#[test]
fn one_of_the_states_is_guarded_against_inversion() {
    let p = plan(Vec::new());
    let u = inverted(&p);
    let pose = |e: usize| CellPose::new(&corners(&p.body, e, &u), p.body.length);
    let guarded = (0..p.body.cells().len()).filter(|e| pose(*e).guard().is_some()).count();
    assert!(guarded > 0);
    // Clear of the jump itself, where nothing has a derivative.
    assert!((0..p.body.cells().len()).all(|e| pose(e).distance() > 0.01));
}

#[test]
fn residual_is_the_gradient_of_the_potential() {
    everywhere(|at| {
        at.with(&at.plan.theta, &at.past, |mut e| {
            let d = random(at.u1.len(), 1e-3, 5);
            let potential = |s: f64| e.potential(&moved(at.u1, s, &d));
            let difference = (potential(STEP) - potential(-STEP)) / (2.0 * STEP);
            let exact = dot(&e.residual(at.u1), &d);
            assert!((difference - exact).abs() < 1e-6 * exact.abs().max(1e-6), "{difference} {exact}");
        });
    });
}

fn difference(f: impl Fn(f64) -> Vec<DVec3>) -> Vec<DVec3> {
    f(STEP).iter().zip(f(-STEP)).map(|(a, b)| (*a - b) / (2.0 * STEP)).collect()
}

#[test]
fn tangent_stiffness_is_the_derivative_of_the_residual() {
    everywhere(|at| {
        let (n, d) = (at.u1.len(), random(at.u1.len(), 1e-3, 5));
        let product = at.with(&at.plan.theta, &at.past, |mut e| {
            let mut matrix = crate::linear::matrix::Matrix::default();
            e.residual(at.u1);
            e.tangent(at.u1, Curvature::Exact, &mut matrix);
            let mut product = zeros(n);
            Packed::new(&e.context.pattern.blocks, &matrix, |v| v).multiply(&d, &mut product);
            product
        });
        let fd = difference(|t| at.residual(&moved(at.u1, t, &d), &at.past));
        assert!(off(&product, &fd) < CLOSE, "{:.1e}", off(&product, &fd));
    });
}

/// What a solve falls back on where the tangent stiffness is indefinite.
#[test]
fn convex_tangents_have_no_negative_eigenvalue() {
    let indefinite = Cell::new(0);
    everywhere(|at| {
        // A law of cells may be softer than nothing.
        if at.plan.layout.effects().any(|(law, _)| matches!(law.site, Site::Cells(_))) {
            return;
        }
        let n = at.u1.len();
        // Twice as far from rest as what derivatives are compared at.
        let u1: Vec<DVec3> = at.u1.iter().map(|u| *u * 2.0).collect();
        let [exact, convex] = [Curvature::Exact, Curvature::Convex].map(|curvature| {
            at.with(&at.plan.theta, &at.past, |mut e| {
                let mut matrix = crate::linear::matrix::Matrix::default();
                if !e.residual(&u1).iter().all(|f| f.is_finite()) {
                    return None;
                }
                e.tangent(&u1, curvature, &mut matrix);
                let packed = Packed::new(&e.context.pattern.blocks, &matrix, |v| v);
                let mut dense = faer::Mat::<f64>::zeros(3 * n, 3 * n);
                for k in 0..3 * n {
                    let (mut unit, mut column) = (zeros(n), zeros(n));
                    unit[k / 3][k % 3] = 1.0;
                    packed.multiply(&unit, &mut column);
                    (0..3 * n).for_each(|i| dense[(i, k)] = column[i / 3][i % 3]);
                }
                let values = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
                Some(values[0] / values[3 * n - 1])
            })
        });
        let (Some(exact), Some(convex)) = (exact, convex) else { return };
        indefinite.set(indefinite.get() + usize::from(exact < -1e-3));
        assert!(convex > -1e-12, "{convex} where the exact one has {exact}");
    });
    println!("{} of them are indefinite", indefinite.get());
    assert!(indefinite.get() > 5);
}

#[test]
fn derivatives_by_the_past_and_their_transposes() {
    everywhere(|at| {
        let Some(stage) = at.stage else { return };
        let n = at.u1.len();
        let change = |i: u64| MemberState { u: random(n, 1e-3, 5 + i), v: random(n, 1e-1, 15 + i) };
        let changes: Vec<MemberState> = (0..at.past.len() as u64).map(change).collect();
        let (by_past, back) = at.with(&at.plan.theta, &at.past, |mut e| {
            e.residual(at.u1);
            let sums = Start::new(stage, &changes.iter().collect::<Vec<_>>());
            let (u, v) = sums.sums();
            let each: Vec<&[DVec3]> = changes.iter().map(|c| c.u.as_slice()).collect();
            (e.by_past(at.u1, &PastChange { u, v, each: &each }), e.by_past_transposed(at.u1, &random(n, 1.0, 7)))
        });
        let fd = difference(|t| at.residual(at.u1, &shifted(&at.past, t, &changes)));
        assert!(off(&by_past, &fd) < CLOSE, "{:.1e}", off(&by_past, &fd));
        let left = dot(&random(n, 1.0, 7), &by_past);
        let mut right = 0.0;
        for ((c, (_, weight)), each) in changes.iter().zip(&stage.from).zip(&back.each) {
            right += weight * (dot(&back.u, &c.u) + dot(&back.v, &c.v)) + dot(each, &c.u);
        }
        assert!((left - right).abs() < 1e-11 * left.abs().max(right.abs()), "{left} {right}");
    });
}

/// States moved by `t` times as many changes.
fn shifted(states: &[MemberState], t: f64, changes: &[MemberState]) -> Vec<MemberState> {
    let one = |(s, d): (&MemberState, &MemberState)| MemberState { u: moved(&s.u, t, &d.u), v: moved(&s.v, t, &d.v) };
    states.iter().zip(changes).map(one).collect()
}

#[test]
fn derivatives_by_every_parameter_and_all_of_them_transposed_at_once() {
    everywhere(|at| {
        let (p, n) = (at.plan, at.u1.len());
        // Of every number with differences: one state tells as much as two.
        if at.seed == 2 {
            return;
        }
        let z = random(n, 1.0, 7);
        let w = world(p, &p.theta);
        let wanted = vec![true; p.layout.len()];
        let mut gradient = Gradient::new(p, wanted.clone());
        at.with(&p.theta, &at.past, |mut e| {
            e.residual(at.u1);
            e.by_coefficients_transposed(at.u1, &z, &gradient.sought, &mut gradient.coefficients);
        });
        let mut pulled = vec![0.0; p.layout.len()];
        w.members[0].coefficients.pull_back(p, &gradient.coefficients, &wanted, &mut pulled);
        for (i, key) in p.layout.keys.iter().enumerate() {
            let size = p.theta[i].abs().max(key.spec().typical.min(1.0));
            let residual = |t: f64| {
                let mut theta = p.theta.clone();
                theta[i] += t * size;
                at.with(&theta, &at.past, |mut e| e.residual(at.u1))
            };
            let d = 1e-5;
            let fd: Vec<DVec3> = residual(d).iter().zip(residual(-d)).map(|(a, b)| (*a - b) / (2.0 * d * size)).collect();
            let rates = simulate::rates(&w.shared, &w.members[0], &[Direction::Parameter(i)]);
            let (column, forces) = at.with(&p.theta, &at.past, |mut e| {
                let forces = e.residual(at.u1).iter().map(|v| v.length()).fold(0.0, f64::max);
                (e.by_coefficients(at.u1, &rates[0]), forces)
            });
            let scale = fd.iter().chain(&column).map(|v| v.length()).fold(0.0, f64::max);
            let difference = column.iter().zip(&fd).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
            // Relative to the column, or to what rounding of the forces leaves of a difference.
            let path = key.spec().path;
            assert!(difference < 1e-6 * scale + 1e-9 * forces / size, "{path} {difference:.1e} of {scale:.1e}");
            let (along, size) = (dot(&z, &column), z.iter().zip(&column).map(|(a, b)| a.length() * b.length()).sum::<f64>());
            // A clamp's motion is differenced over a microsecond, which leaves 1e-10 of rounding.
            let close = if *key == ParamKey::TimeStart { 1e-9 } else { 1e-12 };
            assert!((along - pulled[i]).abs() <= close * size, "{path}: {along} {}", pulled[i]);
        }
    });
}
