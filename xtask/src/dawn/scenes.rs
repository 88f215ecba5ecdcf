//! What Dawn computes: a block that lands on a plane while a camera looks on, as cells and as tetrahedra, with laws on nodes, patches and cells.

use palpate::{Experiment, Interrupt, Liveliness};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch, Request};
use palpate_model::plan::Plan;

/// Without what it is made of.
const SCENE: &str = r#"
format = "scene/1"
[object]
shape = { box = { min = [0, 0, 0], max = [0.04, 0.04, 0.08] } }
OBJECT
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
stiffness_damping = 0.002
[[plane]]
point = [0, 0, 0.001]
normal = [0, 0, 1]
[initial]
velocity = [0.2, 0.0, -0.6]
angular_velocity = [0.0, 2.0, 0.0]
[time]
step = 0.005
steps = 1
"#;
const EFFECTS: &str = r#"
[[effect]]
kind = "air-drag"
coefficient = 5.0
[[effect]]
kind = "strain-stiffening"
coefficient = 0.2
[[effect]]
kind = "uniform-force"
force = [20.0, 0.0, 10.0]
"#;
/// On cells alone: on tetrahedra the device's Newton method does not get through a landing with so much of it.
const FRICTION: &str = "[[effect]]\nkind = \"coulomb-friction\"\ncoefficient = 0.5\n";
const CAMERA: &str = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30";

/// How the body moves in the step, by nodes.
#[derive(Debug)]
pub struct Moved {
    /// Displacements after it [m].
    pub u: Vec<[f64; 3]>,
    /// Velocities after it [m/s].
    pub v: Vec<[f64; 3]>,
    /// The largest of them.
    pub way: f64,
    /// The largest of them.
    pub speed: f64,
}

/// Names and plans.
///
/// # Errors
/// A scene cannot be made.
pub fn all() -> Result<Vec<(&'static str, Plan)>, String> {
    let bodies =
        [("cells", "cell_size = 0.02", FRICTION), ("tetrahedra", "discretisation = \"tetrahedra\"\nedge_length = 0.03", "")];
    bodies.into_iter().map(|(name, object, more)| Ok((name, plan(&SCENE.replace("OBJECT", object), more)?))).collect()
}

/// The plan of a scene that a camera has seen without the effects, and more of them.
fn plan(scene: &str, more: &str) -> Result<Plan, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let file = |name: &str| folder.path().join(name);
    let write = |name: &str, text: String| std::fs::write(file(name), text).map_err(|e| format!("{name}: {e}"));
    write("scene.toml", scene.to_string())?;
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let seen = file("seen").display().to_string();
    let arguments =
        ["palpate", "observe", &file("scene.toml").display().to_string(), "--camera", CAMERA, "--backend", "cpu", "--out", &seen]
            .map(String::from);
    if palpate::cli::run(arguments, &mut out, &mut err, Interrupt::default(), Liveliness::Silent) != 0 {
        return Err(String::from_utf8_lossy(&err).into_owned());
    }
    let observed = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n";
    write("fit.toml", scene.to_string() + observed + EFFECTS + more)?;
    Experiment::open(file("fit.toml")).map(|e| e.plan().clone()).map_err(|e| e.to_string())
}

/// The step on the CPU.
///
/// # Errors
/// It cannot be computed.
pub fn on_cpu(plan: &Plan) -> Result<Moved, String> {
    let backend = CpuBackend;
    let mut world = backend.build(plan, 1).map_err(|e| e.message)?;
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &Request::default());
    let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
    backend.start(&mut world, &mut now, &mut tally);
    backend.step(&mut world, &plan.clock.stages()[0], &[&now], &mut next, &mut tally);
    let (u, v) = backend.read_state(&world, &next, 0);
    let most = |all: &[glam::DVec3]| all.iter().map(|v| v.length()).fold(0.0, f64::max);
    let (way, speed) = (most(&u), most(&v));
    let flat = |all: Vec<glam::DVec3>| all.into_iter().map(|v| v.to_array()).collect();
    Ok(Moved { u: flat(u), v: flat(v), way, speed })
}
