//! True bodies of the coverage study, drawn by number: what they are made of, how they start and what they stand on.

use crate::suite::setup::Setup;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Kinds of bodies: beams and plates that swing, blocks that are pushed, balls that bounce and balls that come to rest.
pub const KINDS: [&str; 5] = ["beam", "plate", "block", "bouncing ball", "resting ball"];

/// Numbers drawn from a seed.
pub struct Draw(ChaCha8Rng);

impl Draw {
    /// The draws of this seed.
    pub fn new(seed: u64) -> Draw {
        Draw(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Evenly between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Evenly between the logarithms of two numbers.
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }
}

/// A true body.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Its kind.
    pub kind: &'static str,
    /// The seed it was drawn from.
    pub seed: u64,
    /// Object, material and support as scene file, with the true values; `theta` is ½, as the recording's scheme is of second order.
    pub body: String,
    /// Young's modulus [Pa], stiffness damping [s], density [kg/m³].
    pub material: [f64; 3],
    /// Velocity and angular velocity at the start.
    pub start: [[f64; 3]; 2],
    /// What it turns about [m].
    pub pivot: Option<[f64; 3]>,
    /// True where it touches a plane.
    pub touches: bool,
    /// Where it is watched [m], from this far.
    pub middle: DVec3,
    /// See [`Truth::middle`].
    pub size: f64,
    /// Markers on its surface.
    pub markers: Vec<(String, [f64; 3])>,
    /// Step of the scene [s] and their number.
    pub step: f64,
    /// See [`Truth::step`].
    pub steps: usize,
    /// Steps of the simulator in one of the scene.
    pub substeps: usize,
}

/// Object and support of a kind.
struct Shape {
    object: String,
    support: String,
    cell: f64,
    stiff: f64,
    start: [[f64; 3]; 2],
    pivot: Option<[f64; 3]>,
    middle: DVec3,
    markers: Vec<(String, [f64; 3])>,
}

/// True where the scene of a body, by its number or its seed, states the material that the recorded body has. The others state the default: both are
/// the same for small strains.
pub fn states_its_material(number: u64) -> bool {
    !number.is_multiple_of(2)
}

/// The true body of a kind and number.
pub fn truth(kind: usize, number: u64) -> Truth {
    let seed = 1_000 * (kind as u64 + 1) + number;
    let d = &mut Draw::new(seed);
    let size = d.log(0.04, 0.08);
    let shape = match kind {
        0 => beam(d, size),
        1 => plate(d, size),
        2 => block(d, size),
        _ => ball(d, size, kind == 3),
    };
    let density = d.log(300.0, 1200.0);
    let modulus = density * 9.81 * size * shape.stiff;
    let (nu, beta) = (d.between(0.3, 0.42), d.log(0.002, 0.006));
    let model = if states_its_material(number) { "stable-neo-hookean" } else { "corotated-linear" };
    let touches = kind >= 3;
    let (step, steps) = if touches { (0.005, 50) } else { (0.008, 36) };
    let body = format!(
        "format = \"scene/1\"\n[object]\nshape = {}\ncell_size = {}\n[material]\nmodel = \"{model}\"\ndensity = {density}\n\
         youngs_modulus = {modulus}\npoisson_ratio = {nu}\nstiffness_damping = {beta}\n{}[time]\nstep = {step}\nsteps = {steps}\ntheta = 0.5\n",
        shape.object, shape.cell, shape.support
    );
    Truth {
        kind: KINDS[kind],
        seed,
        body,
        material: [modulus, beta, density],
        start: shape.start,
        pivot: shape.pivot,
        touches,
        middle: shape.middle,
        size,
        markers: shape.markers,
        step,
        steps,
        // Twice as many change what a fit finds by a thousandth; of a body that bounces by more.
        substeps: if kind == 3 { 6 } else { 4 },
    }
}

fn named(all: &[(&str, [f64; 3])]) -> Vec<(String, [f64; 3])> {
    all.iter().map(|(n, p)| (n.to_string(), *p)).collect()
}

fn beam(d: &mut Draw, size: f64) -> Shape {
    let (length, w) = (d.between(2.2, 3.0) * size, d.between(0.36, 0.46) * size);
    let (clamp, h) = (0.3 * size, 0.5 * w);
    Shape {
        object: format!("{{ box = {{ min = [0, {}, {}], max = [{length}, {h}, {h}] }} }}", -h, -h),
        support: format!("[[clamp]]\nbox = {{ min = [{}, -1, -1], max = [{clamp}, 1, 1] }}\n", -0.1 * size),
        cell: 0.5 * w,
        stiff: d.log(800.0, 2500.0),
        start: [[0.0; 3], [0.0, d.between(-1.5, 1.5), d.between(1.0, 2.5)]],
        pivot: Some([clamp, 0.0, 0.0]),
        middle: DVec3::new(0.55 * length, 0.0, -0.2 * w),
        markers: named(&[("tip", [length, 0.0, 0.0]), ("top", [0.75 * length, 0.0, h]), ("half", [0.55 * length, -h, 0.0])]),
    }
}

fn plate(d: &mut Draw, size: f64) -> Shape {
    let (half, thick, high) = (d.between(0.7, 1.0) * size, d.between(0.25, 0.35) * size, d.between(1.6, 2.1) * size);
    let held = 0.8 * high;
    Shape {
        object: format!("{{ box = {{ min = [{}, {}, 0], max = [{half}, {}, {high}] }} }}", -half, -0.5 * thick, 0.5 * thick),
        support: format!("[[clamp]]\nbox = {{ min = [-1, -1, {held}], max = [1, 1, {}] }}\n", 1.5 * high),
        cell: 0.6 * thick,
        stiff: d.log(150.0, 500.0),
        start: [[0.0; 3], [d.between(3.0, 6.0), 0.0, d.between(-1.0, 1.0)]],
        pivot: Some([0.0, 0.0, held]),
        middle: DVec3::new(0.0, 0.0, 0.45 * high),
        markers: named(&[
            ("corner", [half, 0.0, 0.05 * high]),
            ("other", [-half, 0.0, 0.1 * high]),
            ("side", [0.4 * half, -0.5 * thick, 0.4 * high]),
        ]),
    }
}

fn block(d: &mut Draw, size: f64) -> Shape {
    let (x, y, high) = (d.between(0.4, 0.55) * size, d.between(0.4, 0.55) * size, d.between(1.6, 2.2) * size);
    let clamp = 0.3 * size;
    Shape {
        object: format!("{{ box = {{ min = [{}, {}, 0], max = [{x}, {y}, {high}] }} }}", -x, -y),
        support: format!("[[clamp]]\nbox = {{ min = [-1, -1, {}], max = [1, 1, {clamp}] }}\n", -size),
        cell: 0.3 * size,
        stiff: d.log(80.0, 250.0),
        start: [[d.between(0.2, 0.5), d.between(-0.3, 0.3), 0.0], [0.0; 3]],
        pivot: Some([0.0, 0.0, clamp]),
        middle: DVec3::new(0.0, 0.0, 0.5 * high),
        markers: named(&[("top", [0.0, 0.0, high]), ("edge", [x, 0.0, 0.8 * high]), ("front", [0.0, -y, 0.6 * high])]),
    }
}

fn ball(d: &mut Draw, r: f64, bounces: bool) -> Shape {
    let height = if bounces { d.between(1.1, 1.3) * r } else { 1.005 * r };
    let slope = if bounces { d.between(0.0, 0.2) } else { 0.0 };
    let fall = if bounces { d.between(-0.6, -0.2) } else { 0.0 };
    // Of a sphere the ground is as far along its normal as it is below.
    let down = height / (1.0 + slope * slope).sqrt() - r;
    Shape {
        object: format!("{{ ball = {{ radius = {r}, center = [0, 0, {height}] }} }}"),
        support: format!("[[plane]]\npoint = [0, 0, {}]\nnormal = [{slope}, 0, 1]\n", if down < 0.0 { down } else { 0.0 }),
        cell: 0.4 * r,
        stiff: if bounces { d.log(40.0, 150.0) } else { d.log(12.0, 40.0) },
        start: [[if bounces { d.between(0.0, 0.3) } else { 0.0 }, 0.0, fall], [0.0; 3]],
        pivot: None,
        middle: DVec3::new(0.0, 0.0, 0.8 * height),
        markers: Vec::new(),
    }
}

impl Truth {
    /// The scene with the truth, seen by nothing.
    pub fn setup(&self) -> Setup {
        Setup {
            name: format!("{} {}", self.kind, self.seed),
            body: self.body.clone(),
            given: Vec::new(),
            fit: String::new(),
            cameras: Vec::new(),
            poses: Vec::new(),
            markers: Vec::new(),
            spacing: 2.0 * self.step,
            noise: 0.0,
            start: self.start,
            pivot: self.pivot,
            other_start: [[0.0; 3]; 2],
        }
    }
}
