//! Memory that making a body takes, against what is said of it before. One test alone: what others take meanwhile would be counted too.

use glam::{DAffine3, DVec3};
use palpate::Experiment;
use palpate_cpu::{CpuBackend, Sizes};
use palpate_engine::{Evaluate as _, ParamBatch, Request, Rollout, Wanted};
use palpate_model::cutcells::build::{SUBDIVISIONS, memory};
use palpate_model::plan::Plan;
use palpate_model::plan::build::plan_memory;
use palpate_model::scene::Analytic;
use palpate_model::shape::Placed;
use palpate_model::space::body::Body;
use palpate_model::space::pattern::Pattern;
use peak_alloc::PeakAlloc;
use std::fs;
use std::hint::black_box;
use std::path::Path;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// The most that anything takes beyond what is there [B].
fn peak(take: impl FnOnce()) -> f64 {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    take();
    MEMORY.peak_usage().saturating_sub(before) as f64
}

/// Never too little is said, or memory runs out that was said to be enough.
fn check(what: &str, said: f64, taken: f64, most: f64) {
    println!("{what}: {:.1} MB said, {:.1} MB taken, {:.2}", said * 1e-6, taken * 1e-6, said / taken);
    assert!((1.0..most).contains(&(said / taken)), "{what}: {said} B said, {taken} B taken");
}

fn of_cells() {
    let boxed = |x, y, z| Analytic::Box { min: DVec3::ZERO, max: DVec3::new(x, y, z) };
    let shapes = [
        ("cube", boxed(1.0, 1.0, 1.0)),
        ("sheet", boxed(2.0, 2.0, 0.5)),
        ("ball", Analytic::Ball { radius: 0.5, center: DVec3::ZERO }),
        ("ring", Analytic::Torus { major: 1.0, minor: 0.25, center: DVec3::ZERO, axis: DVec3::Z }),
    ];
    for (name, shape) in shapes {
        let shape = Placed::new(shape, DAffine3::IDENTITY);
        for (h, band) in [(0.1, 1.0), (0.1, 4.0), (0.1, 12.0), (0.05, 1.0), (0.05, 4.0)] {
            let said = memory(&shape, h, band * h).expect("it is not refused");
            let taken = peak(|| {
                black_box(Body::build(&shape, h, band * h, SUBDIVISIONS).unwrap_or_else(|e| panic!("{e}")));
            });
            // Lattices below ten thousand cells count as filled.
            check(&format!("{name}, cells of {h} m, {band} around it"), said, taken, 1.8);
        }
    }
}

fn experiment(path: &Path, object: &str, element: &str) -> Experiment {
    let scene = format!(
        "format = \"scene/1\"\n[object]\n{object}\n[material]\ndensity = 1000.0\nyoungs_modulus = 2.0e4\npoisson_ratio = 0.4\n{element}\n\
         [time]\nstep = 0.01\nsteps = 1\n"
    );
    Experiment::from_toml(&scene, path).unwrap_or_else(|e| panic!("{e}"))
}

/// What is said of the body of a scene, and what it takes with the pattern of its matrix.
fn of_scene(what: &str, path: &Path, object: &str, element: &str, most: f64) {
    let mut made = None;
    let taken = peak(|| {
        let body = made.insert(experiment(path, object, element));
        black_box(Pattern::of(body.plan()));
    });
    let made = made.expect("it was made");
    let said = plan_memory(made.scene(), made.shape()).expect("it is not refused");
    check(what, said, taken, most);
}

fn of_tetrahedra() {
    for (shape, edge, element) in [
        ("box = { min = [0, 0, 0], max = [1, 1, 1] }", 0.1, "tet10"),
        ("box = { min = [0, 0, 0], max = [1, 1, 1] }", 0.07, "tet10"),
        ("box = { min = [0, 0, 0], max = [1, 1, 1] }", 0.06, "tet4"),
        ("box = { min = [0, 0, 0], max = [2, 2, 0.25] }", 0.07, "tet10"),
        ("ball = { radius = 0.5, center = [0, 0, 0] }", 0.05, "tet10"),
    ] {
        let object = format!("shape = {{ {shape} }}\ndiscretisation = \"tetrahedra\"\nedge_length = {edge}");
        let what = format!("{shape}, {element} of {edge} m");
        // The same number stands for every edge, whatever part of the lattice is warped, and for cells that measure the volume of few.
        of_scene(&what, Path::new("body.toml"), &object, &format!("[solver]\nelement = \"{element}\""), 2.0);
    }
}

fn of_points() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("body.toml");
    let object = "points = \"rest.ply\"\nshape = { box = { min = [0, 0, 0], max = [1, 1, 1] } }\ndiscretisation = \"points\"";
    let n = 20;
    let mut file = format!("ply\nformat ascii 1.0\nelement vertex {}\n", n * n * n);
    file += "property double x\nproperty double y\nproperty double z\nend_header\n";
    let at = |k: usize| (k as f64 + 0.5) / n as f64;
    for k in 0..n * n * n {
        file += &format!("{} {} {}\n", at(k % n), at(k / n % n), at(k / n / n));
    }
    fs::write(folder.path().join("rest.ply"), file).expect("writable");
    of_scene("a cloud of 20³ points", &path, object, "", 1.8);
}

/// A scene of a block that sags, and of what two markers on it saw.
fn marked(folder: &Path, h: f64, steps: usize, more: &str) -> Experiment {
    let mut rows = String::from("time,name,x,y,z\n");
    for k in 0..=steps {
        rows += &format!("{},a,0.02,0.02,0.08\n{},b,0.0,0.02,0.08\n", 0.01 * k as f64, 0.01 * k as f64);
    }
    fs::create_dir_all(folder.join("seen")).expect("writable");
    fs::write(folder.join("seen/markers.csv"), rows).expect("writable");
    fs::write(folder.join("seen/recording.toml"), "format = \"recording/1\"\n[markers]\nfile = \"markers.csv\"\nrest = [{ name = \"a\", position = [0.02, 0.02, 0.08] }, { name = \"b\", position = [0.0, 0.02, 0.08] }]\n").expect("writable");
    let scene = format!(
        "format = \"scene/1\"\n[object]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.04, 0.04, 0.08] }} }}\ncell_size = {h}\n\
         [material]\ndensity = 1000.0\nyoungs_modulus = 2.0e4\npoisson_ratio = 0.4\n[[clamp]]\nbox = {{ min = [-1, -1, -1], max = [1, 1, 1.0e-3] }}\n\
         [observation]\nrecording = \"seen\"\ncost = \"markers\"\n[time]\nstep = 0.01\nsteps = {steps}\n{more}"
    );
    Experiment::from_toml(&scene, folder.join("block.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// Simulates so many members at once.
fn simulate(plan: &Plan, members: usize, request: &Request) {
    let mut rollout = Rollout::new(CpuBackend, plan, members).unwrap_or_else(|e| panic!("{e:?}"));
    let all = rollout.evaluate(&ParamBatch::from_rows(&vec![plan.theta.clone(); members]), request);
    assert!(all.iter().all(|e| e.failure.is_none()), "{all:?}");
}

fn of_simulations() {
    let folder = tempfile::tempdir().expect("a folder");
    let [plain, back] = [Wanted::Nothing, Wanted::All].map(|gradient| Request { gradient, sensitivities: Vec::new() });
    let forward = Request { gradient: Wanted::Nothing, sensitivities: vec![0, 1, 2] };
    let (direct, iterative) = ("[solver]\nlinear = \"cholesky\"", "[solver]\nlinear = \"cg\"");
    let still = "[initial]\nstate = \"static-equilibrium\"";
    let few = [(1, &plain), (2, &back)];
    let all = [(1, &plain), (4, &plain), (2, &back), (1, &forward)];
    // Short steps of few nodes are solved iteratively though a factor is counted; from 600 nodes on there is a second level.
    for (h, steps, more, asked, most) in [
        (0.008, 4, "", &all[..], 3.5),
        (0.005, 4, "", &all, 4.5),
        (0.004, 2, "", &all, 2.5),
        (0.003, 1, "", &few, 2.5),
        (0.004, 1, iterative, &few, 2.5),
        (0.004, 1, direct, &few, 1.5),
        (0.005, 2, still, &all, 1.5),
        (0.003, 0, still, &few, 1.5),
    ] {
        let made = marked(folder.path(), h, steps, more);
        let (plan, sizes) = (made.plan(), Sizes::new(made.plan()));
        for &(members, request) in asked {
            let said = sizes.memory(members, 1, rayon::current_num_threads(), request).total() as f64;
            let taken = peak(|| simulate(plan, members, request));
            let what =
                format!("{members} of {} nodes, {steps} steps, {}{request:?}", plan.body.nodes.len(), more.replace('\n', " "));
            check(&what, said, taken, most);
        }
    }
}

#[test]
fn what_a_body_takes_is_said_before() {
    // Products of matrices are packed in a buffer of twice the last cache, which is kept and used little of: another machine, another size. The
    // thread that asks computes as well.
    rayon::broadcast(|_| palpate_cpu::settle());
    palpate_cpu::settle();
    of_simulations();
    of_points();
    of_cells();
    of_tetrahedra();
}
