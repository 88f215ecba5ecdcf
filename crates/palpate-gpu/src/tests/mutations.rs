//! One kernel at a time is made wrong, and evaluations that are compared with the CPU must tell: a term is dropped, or has the wrong sign. `PALPATE_MUTANTS=all` in
//! the environment takes every kernel; otherwise one out of [`PART`] stands for them.

use super::effects::with;
use super::elastic::{of_tets, seen as marked};
use super::faults::busy;
use super::scenes::{ball, held, own_device};
use super::{cell_laws::lawful, products};
use crate::costs::rollout_tests::{differences, seen, watched};
use crate::device::Gpu;
use crate::device::pipelines::{PASSES, PassSource, compile};
use crate::{GpuBackend, Product, Tuning};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Tetrahedron;
use std::sync::{Arc, OnceLock};

/// Every so-th kernel is taken where not all are.
const PART: usize = 16;

/// Kernels whose work changes no result, and what watches over them instead.
const WATCHED: [(&str, &str); 3] = [
    ("turn_groups", "coarse::groups_turn_as_the_body_does"),
    ("list_members", "limits::listings_give_every_kind_of_items_the_workgroups_that_its_passes_work_through"),
    ("close_cg", "limits::conjugate_gradients_at_the_bound_of_their_loops_run_all_iterations"),
];

/// A plan, how it is solved, and what the CPU makes of it.
struct Subject {
    plan: Plan,
    tuning: Tuning,
    right: Evaluation,
}

const MANY: Tuning = Tuning { many_from: 0, product: Some(Product::Matrix) };
const FREE: Tuning = Tuning { many_from: 0, product: Some(Product::Free) };
const ONE: Tuning = Tuning { many_from: usize::MAX, product: Some(Product::Matrix) };

impl Subject {
    fn new(plan: Plan, tuning: Tuning) -> Subject {
        let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let right = cpu.evaluate(&moved(&plan), &request(&plan)).remove(0);
        assert!(right.failure.is_none(), "{:?}", right.failure);
        Subject { plan, tuning, right }
    }

    /// Numbers in which the device differs from the CPU, or the words of a failure.
    fn told(&self, gpu: &Arc<Gpu>) -> Vec<String> {
        let backend = GpuBackend::on(gpu.clone()).tuned(self.tuning);
        let mut rollout = match Rollout::new(backend, &self.plan, 1) {
            Ok(r) => r,
            Err(e) => return vec![e.to_string()],
        };
        let found = rollout.evaluate(&moved(&self.plan), &request(&self.plan)).remove(0);
        match found.failure {
            Some(f) => vec![f.to_string()],
            None => differences(&found, &self.right, &request(&self.plan).sensitivities),
        }
    }
}

/// Away from what was measured, so that there is something to explain.
fn moved(plan: &Plan) -> ParamBatch {
    let mut row = plan.theta.clone();
    row[plan.layout.index(ParamKey::YoungsModulus)] *= 1.2;
    ParamBatch::from_rows(&[row])
}

fn request(plan: &Plan) -> Request {
    Request { gradient: Wanted::All, sensitivities: (0..plan.layout.len()).collect() }
}

fn subjects() -> Vec<Subject> {
    let mut crowded = products::crowded();
    crowded.observation = watched();
    with(&mut crowded, "air-drag", &[("coefficient", &[5.0]), ("fluid_density", &[50.0])]);
    let mut lawful_ball = ball(0.03);
    lawful_ball.object.pose.translation.z = -0.006;
    lawful_ball.initial.velocity.z = -1.0;
    lawful_ball.time.steps = 2;
    lawful_ball.observation = watched();
    lawful(&mut lawful_ball);
    with(&mut lawful_ball, "coulomb-friction", &[("coefficient", &[0.3])]);
    let mut hanging = busy(of_tets(held(0.03), Tetrahedron::Linear, 2));
    hanging.time.steps = 2;
    with(&mut hanging, "compliant-clamp", &[("layer", &[0.004])]);
    with(&mut hanging, "transverse-anisotropy", &[("stiffness", &[3.0]), ("fibre", &[1.0, 0.5, -0.3])]);
    with(&mut hanging, "density-gradient", &[("slope", &[3.0])]);
    let mut bare = products::crowded();
    bare.observation = watched();
    vec![
        Subject::new(seen(&crowded), MANY),
        Subject::new(seen(&bare), FREE),
        Subject::new(seen(&bare), ONE),
        Subject::new(seen(&lawful_ball), MANY),
        Subject::new(marked(&hanging), MANY),
    ]
}

/// What is made wrong in a kernel: a word for it, the line, and what stands there instead.
type Mutant = (&'static str, String, String);

/// Candidates among the lines that a kernel's own file has.
fn mutants(own: &str) -> Vec<Mutant> {
    let mut out = Vec::new();
    let lines = own.lines().map(str::trim).filter(|l| l.ends_with(';') && !l.starts_with("for") && !l.starts_with("//"));
    for line in lines {
        let counts = line
            .split(|c: char| !c.is_alphanumeric())
            .any(|w| w.ends_with('u') && w.len() > 1 && w[..w.len() - 1].bytes().all(|b| b.is_ascii_digit()));
        if line.contains(" += ") || line.contains(" -= ") {
            out.push(("a dropped term", line.to_string(), ";".to_string()));
            let turned = if line.contains(" += ") { line.replacen(" += ", " -= ", 1) } else { line.replacen(" -= ", " += ", 1) };
            out.push(("a wrong sign", line.to_string(), turned));
        } else if let Some((left, right)) = line.split_once(" = ").filter(|_| !counts) {
            let turned = if right.contains(" - ") { right.replacen(" - ", " + ", 1) } else { right.replacen(" + ", " - ", 1) };
            if turned != right {
                out.push(("a wrong sign", line.to_string(), format!("{left} = {turned}")));
            }
        }
    }
    out
}

#[test]
fn lines_are_made_wrong_where_they_add_up_or_take_off() {
    let text = "let a = b - c;\nfor (var i = 0u; i < n; i++) {\nsum += x * y;\nlet k = 2u * at - 1u;\n";
    let found = mutants(text);
    let made: Vec<&str> = found.iter().map(|m| m.2.as_str()).collect();
    assert_eq!(made, ["let a = b + c;", ";", "sum -= x * y;"]);
}

#[test]
// Every wrong kernel is compiled, and a rollout or several are computed with it.
#[ignore = "slow: cargo xtask test --full"]
fn a_kernel_that_is_wrong_is_found_out() {
    let Some(mut gpu) = own_device() else { return };
    let all = std::env::var("PALPATE_MUTANTS").is_ok_and(|v| v == "all");
    let subjects = subjects();
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
        if watched || !all && pass % PART != 0 {
            continue;
        }
        let Some(first) = users[pass] else {
            unused.push(source.name);
            continue;
        };
        let own = std::fs::read_to_string(format!("{folder}{}.wgsl", source.name)).unwrap_or_else(|e| panic!("{e}"));
        let candidates = mutants(&own);
        // One of each kind, spread over the file.
        for kind in ["a dropped term", "a wrong sign"] {
            let of_kind: Vec<&Mutant> = candidates.iter().filter(|m| m.0 == kind).collect();
            let Some((_, line, instead)) = of_kind.get(source.name.len() % of_kind.len().max(1)) else { continue };
            let wrong = source.sources.map(|text| -> &'static str { text.replacen(line.as_str(), instead, 1).leak() });
            let mutant = PassSource {
                sources: wrong,
                name: source.name,
                bindings: source.bindings,
                overrides: source.overrides,
                ..*source
            };
            let Some(owned) = Arc::get_mut(&mut gpu) else { panic!("somebody keeps the device") };
            let Ok(kernel) = compile(owned, &mutant, &owned.pipelines) else { continue };
            let right = owned.pipelines.swap(pass, OnceLock::from(Ok(kernel)));
            made += 1;
            let caught = (first..subjects.len()).find_map(|k| subjects[k].told(&gpu).into_iter().next());
            println!("{}: {kind} in `{line}`: {}", source.name, caught.as_deref().unwrap_or("NOT SEEN"));
            if caught.is_none() {
                survivors.push(format!("{}: {kind} in `{line}`", source.name));
            }
            let Some(owned) = Arc::get_mut(&mut gpu) else { panic!("somebody keeps the device") };
            owned.pipelines.swap(pass, right);
        }
    }
    println!("{made} wrong kernels, {} not seen; kernels that no subject uses: {unused:?}", survivors.len());
    assert!(made > 0 && survivors.is_empty(), "{survivors:#?}");
}
