//! One kernel at a time is made wrong, and evaluations that are compared with the CPU must tell: a term is dropped, or has the wrong sign, or the
//! smallest cell is one percent stiffer. `PALPATE_MUTANTS` in the environment
//! lists kernels, or says `all`; otherwise one out of [`PART`] stands for them.

use super::collapse::{measured, pressed};
use super::effects::with;
use super::elastic::{of_tets, seen as marked};
use super::faults::busy;
use super::moving::beset;
use super::scenes::{ball, held, own_device};
use super::tet_effects::{slipping, spinning};
use super::{cell_laws::lawful, products};
use crate::costs::rollout_tests::{AGREEMENT, differences_beyond, seen, watched};
use crate::costs::rows_tests::effect;
use crate::device::Gpu;
use crate::device::pipelines::{PASSES, PassSource, compile};
use crate::{GpuBackend, Product, Tuning};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::find;
use palpate_model::scene::{Analytic, BodySource, Clamp, Scene, Tetrahedron};
use std::sync::{Arc, OnceLock};

/// Every so-th kernel is taken where not all are.
const PART: usize = 16;

/// Kernels whose work changes no result, and what watches over them instead.
const WATCHED: [(&str, &str); 4] = [
    ("carry_places", "skinning::tests::places_go_where_their_stencils_say"),
    ("turn_groups", "coarse::groups_turn_as_the_body_does"),
    ("list_members", "limits::listings_give_every_kind_of_items_the_workgroups_that_its_passes_work_through"),
    ("close_cg", "limits::conjugate_gradients_at_the_bound_of_their_loops_run_all_iterations"),
];

/// Lines that may be wrong without any result being so, and why.
const EQUIVALENT: [(&str, &str, &str); 7] = [
    ("begin_solve", "n.scale = f.x + f.y + f.z + f.w;", "says when Newton's method ends, which passes its tolerance by far"),
    ("invert_diagonal", "mass += mass_values[p.member * shape.masses + s] * w * w;", "a preconditioner"),
    (
        "judge_trial",
        "let falls = s.y < n.potential - rounding;",
        "the solution is where the residual vanishes, whatever the way there",
    ),
    (
        "load_jets",
        "let moved = (way.whole - way.old_whole) + (way.rest - way.old_rest);",
        "of the potential, and the solution is where the residual vanishes",
    ),
    ("place_next", "w = (exp2(-f32(n.trial)) - 1.0) * (shape.dt * v + fall);", "a guess"),
    ("press_elastic", "energy += 0.5 * mix.rate * contract(g, linear_stress(g, lame));", "compared where a step is judged alone"),
    ("pull_holds", "let poses = extractBits(call.extra, POSES_AT, MATRICES_AT - POSES_AT);", "more bits of a small number"),
];

/// A plan, how it is solved, what is asked of it, and what the CPU makes of it.
struct Subject {
    plan: Plan,
    tuning: Tuning,
    request: Request,
    /// What each member of the batch should give.
    right: Vec<Evaluation>,
    /// How far it may be off.
    allowed: f64,
}

const MANY: Tuning = Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 };
const FREE: Tuning = Tuning { many_from: 0, product: Some(Product::Free), crew: 0 };
const ONE: Tuning = Tuning { many_from: usize::MAX, product: Some(Product::Matrix), crew: 0 };

impl Subject {
    fn new(plan: Plan, tuning: Tuning) -> Subject {
        Subject::of_members(plan, tuning, 1)
    }

    fn of_members(plan: Plan, tuning: Tuning, members: usize) -> Subject {
        let mut cpu = Rollout::new(CpuBackend, &plan, members).unwrap_or_else(|e| panic!("{e}"));
        let mut of = |sensitivities: Vec<usize>| {
            let request = Request { gradient: Wanted::All, sensitivities };
            let right = cpu.evaluate(&moved(&plan, members), &request);
            right.iter().for_each(|r| assert!(r.failure.is_none(), "{:?}", r.failure));
            (request, right)
        };
        // What moves nothing has nothing to be compared with.
        let (all, whole) = of((0..plan.layout.len()).collect());
        let count = all.sensitivities.len();
        let moves = |i: &usize| whole[0].curvature.as_ref().is_some_and(|c| c.matrix[i * (count + 1)] > 0.0);
        let (request, right) = of(all.sensitivities.into_iter().filter(moves).collect());
        Subject { plan, tuning, request, right, allowed: AGREEMENT }
    }

    /// Numbers in which the device differs from the CPU, or the words of a failure.
    fn told(&self, gpu: &Arc<Gpu>) -> Vec<String> {
        let backend = GpuBackend::on(gpu.clone()).tuned(self.tuning);
        let mut rollout = match Rollout::new(backend, &self.plan, self.right.len()) {
            Ok(r) => r,
            Err(e) => return vec![e.to_string()],
        };
        let found = rollout.evaluate(&moved(&self.plan, self.right.len()), &self.request);
        let told = |(found, right): (Evaluation, &Evaluation)| match found.failure {
            Some(f) => vec![f.to_string()],
            None => differences_beyond(self.allowed, &found, right, &self.request.sensitivities),
        };
        found.into_iter().zip(&self.right).flat_map(told).collect()
    }
}

/// Away from what was measured, so that there is something to explain, each member farther.
fn moved(plan: &Plan, members: usize) -> ParamBatch {
    let row = |b: usize| {
        let mut row = plan.theta.clone();
        row[plan.layout.index(ParamKey::YoungsModulus)] *= 1.2 + 0.1 * b as f64;
        row
    };
    ParamBatch::from_rows(&(0..members).map(row).collect::<Vec<_>>())
}

/// Few iterations of Newton's method: right kernels need no more, and wrong ones do not take long.
fn short(mut scene: Scene) -> Scene {
    scene.solver.newton_iterations = 15;
    scene
}

fn subjects() -> Vec<Subject> {
    let mut crowded = short(products::crowded());
    crowded.observation = watched();
    with(&mut crowded, "air-drag", &[("coefficient", &[5.0]), ("fluid_density", &[50.0])]);
    let mut lawful_ball = short(ball(0.03));
    lawful_ball.object.pose.translation.z = -0.006;
    lawful_ball.initial.velocity.z = -1.0;
    lawful_ball.time.steps = 2;
    lawful_ball.observation = watched();
    lawful(&mut lawful_ball);
    with(&mut lawful_ball, "coulomb-friction", &[("coefficient", &[0.3])]);
    let mut hanging = short(busy(of_tets(held(0.03), Tetrahedron::Linear, 2)));
    hanging.time.steps = 2;
    with(&mut hanging, "compliant-clamp", &[("layer", &[0.004])]);
    with(&mut hanging, "transverse-anisotropy", &[("stiffness", &[3.0]), ("fibre", &[1.0, 0.5, -0.3])]);
    with(&mut hanging, "density-gradient", &[("slope", &[3.0])]);
    let mut bare = short(products::crowded());
    bare.observation = watched();
    // A clamp that slips, other stress-free shapes, what flows and what ages: of cells, of tetrahedra, and of a body that spins freely.
    let mut slipping_cells = short(held(0.03));
    slipping_cells.initial.velocity.z = -1.0;
    slipping_cells.time.steps = 2;
    slipping_cells.observation = watched();
    with(
        &mut slipping_cells,
        "clamp-slip",
        &[("offset", &[0.002, -0.001, 0.001]), ("turn", &[0.02, 0.01, -0.03]), ("drift", &[0.02])],
    );
    with(&mut slipping_cells, "rest-shape", &[("stretch", &[0.04, -0.02, 0.03]), ("bend_x_to_z", &[1.5])]);
    with(&mut slipping_cells, "strain-stiffening", &[("coefficient", &[60.0])]);
    with(&mut slipping_cells, "structural-damping", &[("loss", &[1.0])]);
    with(&mut slipping_cells, "creep", &[("fraction", &[0.6]), ("time", &[0.005])]);
    slipping_cells.material.viscosity = Some(Viscosity { coefficient: 40.0, exponent: 0.7 });
    let mut slipping_tets = short(slipping(of_tets(held(0.03), Tetrahedron::Linear, 1), 0.004));
    with(&mut slipping_tets, "power-law-viscosity", &[("coefficient", &[0.2]), ("exponent", &[0.6])]);
    let mut spinning_cells = short(busy(ball(0.03)));
    spinning_cells.time.steps = 2;
    spinning_cells.initial.angular_velocity = DVec3::new(0.0, 3.0, 5.0);
    with(&mut spinning_cells, "rest-shape", &[("stretch", &[0.02, -0.01, 0.015]), ("bend_y_to_z", &[0.8])]);
    let crushed = measured(&pressed());
    let loose = |subject: Subject, allowed: f64| Subject { allowed, ..subject };
    vec![
        Subject::new(seen(&crowded), MANY),
        Subject::new(seen(&bare), FREE),
        Subject::new(seen(&bare), ONE),
        Subject::new(seen(&lawful_ball), MANY),
        Subject::new(marked(&hanging), MANY),
        Subject::new(seen(&slipping_cells), MANY),
        // What is lost depends on differences of strains, which in a slow step leave three digits.
        loose(Subject::new(marked(&slipping_tets), MANY), 1e-3),
        Subject::new(seen(&spinning_cells), MANY),
        Subject::of_members(seen(&short(beset())), MANY, 2),
        loose(Subject::new(marked(&short(spinning())), MANY), 5e-4),
        Subject::new(crushed.clone(), MANY),
        Subject::new(crushed, FREE),
    ]
}

/// Ways to make a line wrong.
const WAYS: [&str; 2] = ["a dropped term", "a wrong sign"];

/// A line made wrong; `None` where this way does not apply.
fn made_wrong(way: &str, line: &str) -> Option<String> {
    let adds = line.contains(" += ") || line.contains(" -= ");
    if way == WAYS[0] {
        return adds.then(|| ";".to_string());
    }
    if adds {
        let turned = if line.contains(" += ") { line.replacen(" += ", " -= ", 1) } else { line.replacen(" -= ", " += ", 1) };
        return Some(turned);
    }
    let (left, right) = line.split_once(" = ")?;
    // What stands in brackets says where something lies.
    let outside = |at: usize| right[..at].matches('[').count() == right[..at].matches(']').count();
    let (at, sign) = right.match_indices(" - ").chain(right.match_indices(" + ")).find(|(at, _)| outside(*at))?;
    let other = if sign == " - " { " + " } else { " - " };
    Some(format!("{left} = {}{other}{}", &right[..at], &right[at + 3..]))
}

/// Lines of a kernel's own file that this way makes wrong. Whole numbers count items and say where something lies.
fn candidates<'a>(way: &str, own: &'a str) -> Vec<&'a str> {
    let whole = |word: &str| word.strip_suffix('u').is_some_and(|d| !d.is_empty() && d.bytes().all(|b| b.is_ascii_digit()));
    let counts = |line: &str| {
        let of_items = ["Health(", "let index =", "s.first"].iter().any(|part| line.contains(part));
        of_items || line.split(|c: char| !c.is_alphanumeric()).any(whole)
    };
    let lines = own.lines().map(str::trim).filter(|l| l.ends_with(';') && !l.starts_with("for") && !l.starts_with("//"));
    lines.filter(|l| made_wrong(way, l).is_some() && !counts(l)).collect()
}

/// A linked kernel with a line of its own file made wrong. Where tables lie in arenas the linker has written the reads, and the line as it was
/// behind them.
fn with_line_wrong(way: &str, text: &str, line: &str) -> Option<String> {
    let written = format!(" // {line}");
    let found = text.lines().find(|l| l.trim() == line || l.ends_with(&written))?;
    let code = found.split(" // ").next().unwrap_or(found);
    Some(text.replacen(found, &made_wrong(way, code)?, 1))
}

#[test]
fn lines_are_made_wrong_where_they_add_up_or_take_off() {
    let own = "let a = b[i + k] - c;\nfor (var i = 0u; i < n; i++) {\nsum += x * y;\nlet k = 2u * at - 1u;\nlet d = e[i + k];\n";
    assert_eq!(candidates(WAYS[0], own), ["sum += x * y;"]);
    assert_eq!(candidates(WAYS[1], own), ["let a = b[i + k] - c;", "sum += x * y;"]);
    let linked = "{\n    sum += arena[7u + k] * y; // sum += x[k] * y;\n}";
    let wrong = with_line_wrong(WAYS[1], linked, "sum += x[k] * y;");
    assert_eq!(wrong.as_deref(), Some("{\n    sum -= arena[7u + k] * y;\n}"));
}

#[test]
// Every wrong kernel is compiled, and a rollout or several are computed with it.
#[ignore = "slow: cargo xtask test --full"]
fn a_kernel_that_is_wrong_is_found_out() {
    let Some(mut gpu) = own_device() else { return };
    let asked = std::env::var("PALPATE_MUTANTS").unwrap_or_default();
    // Small ones answer sooner.
    let subjects: Vec<Subject> = small().into_iter().map(|s| s.0).chain(subjects()).collect();
    // The first subject that uses a kernel is asked first.
    let mut users: Vec<Option<usize>> = vec![None; PASSES.len()];
    for (k, subject) in subjects.iter().enumerate() {
        let told = subject.told(&gpu);
        assert!(told.is_empty(), "subject {k} with right kernels: {told:?}");
        for (pass, user) in users.iter_mut().enumerate() {
            *user = user.or(gpu.pipelines.is_compiled(pass).then_some(k));
        }
    }
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/passes/");
    let (mut made, mut survivors, mut unused) = (0, Vec::new(), Vec::new());
    for (pass, source) in PASSES.iter().enumerate() {
        let watched = WATCHED.iter().any(|w| w.0 == source.name) || source.name.starts_with("probe_");
        let named = asked.split(',').any(|name| name == source.name || name == "all");
        if watched || !(named || asked.is_empty() && pass % PART == 0) {
            continue;
        }
        let Some(first) = users[pass] else {
            unused.push(source.name);
            continue;
        };
        let own = std::fs::read_to_string(format!("{folder}{}.wgsl", source.name)).unwrap_or_else(|e| panic!("{e}"));
        // One of each kind, spread over the file.
        for kind in WAYS {
            let of_kind = candidates(kind, &own);
            let Some(line) = of_kind.get(source.name.len() % of_kind.len().max(1)) else { continue };
            let wrong = source.sources.map(|text| with_line_wrong(kind, text, line));
            let [Some(subgroup), Some(memory)] = wrong else { panic!("{}: no line `{line}`", source.name) };
            let wrong: [&'static str; 2] = [subgroup.leak(), memory.leak()];
            let seen = |gpu: &Arc<Gpu>| (first..subjects.len()).find_map(|k| subjects[k].told(gpu).into_iter().next());
            let Some(caught) = with_wrong(&mut gpu, pass, wrong, seen) else { continue };
            made += 1;
            let reason = EQUIVALENT.iter().find(|e| e.0 == source.name && e.1 == *line).map(|e| e.2);
            println!("{}: {kind} in `{line}`: {}", source.name, caught.as_deref().or(reason).unwrap_or("NOT SEEN"));
            if caught.is_none() && reason.is_none() {
                survivors.push(format!("{}: {kind} in `{line}`", source.name));
            }
        }
    }
    println!("{made} wrong kernels, {} not seen; kernels that no subject uses: {unused:?}", survivors.len());
    assert!(made > 0 && survivors.is_empty(), "{survivors:#?}");
}

/// What is told while a kernel has another text; `None` where that does not compile.
fn with_wrong<T>(gpu: &mut Arc<Gpu>, pass: usize, wrong: [&'static str; 2], told: impl Fn(&Arc<Gpu>) -> T) -> Option<T> {
    let owned = Arc::get_mut(gpu).unwrap_or_else(|| panic!("somebody keeps the device"));
    let mutant = PassSource { sources: wrong, ..PASSES[pass] };
    let kernel = compile(owned, &mutant, &owned.pipelines).ok()?;
    let right = owned.pipelines.swap(pass, OnceLock::from(Ok(kernel)));
    let told = told(gpu);
    Arc::get_mut(gpu).unwrap_or_else(|| panic!("somebody keeps the device")).pipelines.swap(pass, right);
    Some(told)
}

/// How far a body of two cells may be off, ten times what rounding leaves of it.
const CLOSE: f64 = 1e-4;

/// Bodies of two or three elements, so that each matters, with the number of the smallest one.
fn small() -> Vec<(Subject, usize)> {
    let hanging = |mut scene: Scene| {
        // In one column of cells.
        let (min, max) = (DVec3::new(0.001, 0.001, 0.03), DVec3::new(0.029, 0.029, 0.075));
        scene.object.source = BodySource::Analytic(Analytic::Box { min, max });
        let motion = scene.clamps[0].motion.take();
        scene.clamps = vec![Clamp::still(DVec3::new(-1.0, -1.0, 0.065), DVec3::ONE).moved(motion)];
        scene.masses.clear();
        scene.material.youngs_modulus = 1500.0;
        // The state before counts for as much as the new one.
        scene.material.stiffness_damping = 0.02;
        scene.time.steps = 4;
        scene.observation = watched();
        short(scene)
    };
    let plain = hanging(held(0.03));
    let mut lawful_one = hanging(held(0.03));
    // Laws of rates want some.
    lawful_one.initial.velocity.z = -1.0;
    lawful(&mut lawful_one);
    let mut tets = hanging(held(0.03));
    let source = of_tets(held(0.03), Tetrahedron::Linear, 1);
    (tets.object, tets.solver.tetrahedron) = (source.object, Tetrahedron::Linear);
    tets.initial.velocity.z = -0.3;
    with(&mut tets, "transverse-anisotropy", &[("stiffness", &[3.0]), ("fibre", &[1.0, 0.5, -0.3])]);
    with(&mut tets, "power-law-viscosity", &[("coefficient", &[0.2]), ("exponent", &[0.6])]);
    let mut late = plain.clone();
    late.time.scheme = find("bdf2").unwrap_or_else(|| panic!("there is one"));
    let close = |subject| Subject { allowed: CLOSE, ..subject };
    let of_cells = |scene: &Scene, tuning| {
        let plan = seen(scene);
        let volume = |i: &usize| plan.body.cells()[*i].fraction;
        let smallest = (0..plan.body.cells().len()).min_by(|a, b| volume(a).total_cmp(&volume(b)));
        (close(Subject::new(plan.clone(), tuning)), smallest.unwrap_or_else(|| panic!("a body has cells")))
    };
    let of_tets = (close(Subject::new(marked(&tets), MANY)), 0);
    let mut off = plain.clone();
    off.effects =
        vec![effect("depth-bias", &[(0, 4e-3)]), effect("depth-scale", &[(0, 0.01)]), effect("depth-along-ray", &[(0, 0.2)])];
    let mut two = of_cells(&off, MANY);
    two.0 = close(Subject::of_members(two.0.plan.clone(), MANY, 2));
    vec![two, of_cells(&plain, FREE), of_cells(&lawful_one, MANY), of_tets, of_cells(&late, MANY)]
}

/// Whether a kernel does more than declare how stiff an element is, or note it for a cell (`shared/corner`).
fn asks_for_stiffness(text: &str) -> bool {
    let noted = if text.contains("c.young = young_at(") { 3 } else { 1 };
    text.matches("young_at(").count() + text.matches("c.young").count() > noted
}

#[test]
// Every kernel that asks for the stiffness of an element is compiled once more.
#[ignore = "slow: cargo xtask test --full"]
fn one_percent_in_the_smallest_cell_is_found_out() {
    let Some(mut gpu) = own_device() else { return };
    let subjects = small();
    for (k, (subject, _)) in subjects.iter().enumerate() {
        let shares: Vec<String> = subject.plan.body.cells().iter().map(|c| format!("{:.2}", c.fraction)).collect();
        println!("subject {k}: {} elements, {}", subject.plan.body.elements(), shares.join(" "));
        let told = subject.told(&gpu);
        assert!(told.is_empty(), "subject {k} with right kernels: {told:?}");
    }
    let stiffer = |text: &'static str, element: usize| -> &'static str {
        let Some((before, after)) = text.split_once("fn young_at(") else { return text };
        let after = after.replacen("return young;", &format!("return young * select(1.0, 1.01, element == {element}u);"), 1);
        format!("{before}fn young_at({after}").leak()
    };
    let mut survivors = Vec::new();
    for (pass, source) in PASSES.iter().enumerate() {
        if source.name.starts_with("probe_") || !asks_for_stiffness(source.sources[0]) {
            continue;
        }
        let caught = subjects.iter().find_map(|(subject, smallest)| {
            let wrong = source.sources.map(|text| stiffer(text, *smallest));
            let told = with_wrong(&mut gpu, pass, wrong, |gpu| subject.told(gpu));
            told.unwrap_or_else(|| panic!("{} does not compile", source.name)).into_iter().next()
        });
        println!("{}: {}", source.name, caught.as_deref().unwrap_or("NOT SEEN"));
        if caught.is_none() {
            survivors.push(source.name);
        }
    }
    assert!(survivors.is_empty(), "{survivors:?}");
}
