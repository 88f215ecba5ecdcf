//! Small scenes drawn by number: balls, beams, plates, blocks, blobs and rings of 60 to 200 nodes, each with its own size, stiffness,
//! damping, noise and sensors. Nothing is hidden in them: they ask how often a method sees something where there is nothing.

use super::setup::Setup;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Kinds of drawn scenes.
pub const KINDS: [&str; 6] = ["ball", "beam", "plate", "block", "blob", "ring"];

/// Numbers drawn for one scene.
struct Draw {
    rng: ChaCha8Rng,
}

impl Draw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    fn log(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[(self.rng.random::<f64>() * of.len() as f64) as usize % of.len()]
    }

    fn signed(&mut self, size: f64) -> f64 {
        self.between(-size, size)
    }
}

/// Shape, support and start of a kind, in units of its size.
struct Kind {
    shape: String,
    cell: f64,
    support: String,
    center: [f64; 3],
    markers: Vec<(String, [f64; 3])>,
    start: [[f64; 3]; 2],
    pivot: Option<[f64; 3]>,
    other_start: [[f64; 3]; 2],
    /// Bodies that swing show both E and damping.
    swings: bool,
    /// E over density · gravity · size, smallest and largest: strains of some hundredths, and motion above the noise.
    stiff: (f64, f64),
}

/// The scene of this kind and number; the same number is the same scene.
pub fn setup(kind: &str, number: u64) -> Option<Setup> {
    let place = KINDS.iter().position(|k| *k == kind)? as u64;
    let mut d = Draw { rng: ChaCha8Rng::seed_from_u64(7919 * (place + 1) + number) };
    let size = d.log(0.03, 0.09);
    let k = match kind {
        "ball" => ball(&mut d, size),
        "beam" => beam(&mut d, size),
        "plate" => plate(&mut d, size),
        "block" => block(&mut d, size),
        "blob" => blob(&mut d, size),
        _ => ring(&mut d, size),
    };
    Some(k.setup(&mut d, kind, number, size))
}

fn ball(d: &mut Draw, r: f64) -> Kind {
    let height = d.between(1.05, 1.3) * r;
    let (a, b) = (d.signed(0.25), d.signed(0.15));
    let speed = d.signed(0.2);
    Kind {
        shape: format!("{{ ball = {{ radius = {r}, center = [0, 0, {height}] }} }}"),
        cell: d.between(0.62, 0.72) * r,
        support: format!("[[plane]]\npoint = [0, 0, 0]\nnormal = [{a}, {b}, 1]\n"),
        center: [0.0, 0.0, height],
        markers: Vec::new(),
        start: [[speed, 0.0, d.between(-0.3, 0.0)], [0.0; 3]],
        pivot: None,
        other_start: [[0.1, 0.05, -0.25], [0.0; 3]],
        swings: false,
        stiff: (25.0, 120.0),
    }
}

fn beam(d: &mut Draw, size: f64) -> Kind {
    let (length, w) = (d.between(2.2, 3.2) * size, d.between(0.32, 0.45) * size);
    let clamp = 0.3 * size;
    let p = |x: f64, y: f64, z: f64| [x * length, y * w, z * w];
    Kind {
        shape: format!("{{ box = {{ min = [0, {}, {}], max = [{length}, {}, {}] }} }}", -0.5 * w, -0.5 * w, 0.5 * w, 0.5 * w),
        cell: d.between(0.5, 0.62) * w,
        support: format!("[[clamp]]\nbox = {{ min = [{}, -1, -1], max = [{clamp}, 1, 1] }}\n", -0.1 * size),
        center: p(0.55, 0.0, -0.3),
        markers: [("tip", p(1.0, 0.0, 0.0)), ("top", p(0.75, 0.0, 0.5)), ("half", p(0.55, -0.5, 0.0))]
            .map(|(n, at)| (n.to_string(), at))
            .to_vec(),
        start: [[0.0; 3], [0.0, d.signed(1.5), d.signed(2.5)]],
        pivot: Some([clamp, 0.0, 0.0]),
        other_start: [[0.0; 3], [0.0, -1.5, 1.5]],
        swings: true,
        stiff: (500.0, 1800.0),
    }
}

fn plate(d: &mut Draw, size: f64) -> Kind {
    let (half, thick, high) = (d.between(0.7, 1.0) * size, d.between(0.2, 0.28) * size, d.between(1.5, 2.1) * size);
    let held = 0.8 * high;
    Kind {
        shape: format!("{{ box = {{ min = [{}, {}, 0], max = [{half}, {}, {high}] }} }}", -half, -0.5 * thick, 0.5 * thick),
        cell: d.between(0.95, 1.3) * thick,
        support: format!("[[clamp]]\nbox = {{ min = [-1, -1, {held}], max = [1, 1, {}] }}\n", 1.5 * high),
        center: [0.0, 0.0, 0.4 * high],
        markers: vec![("corner".into(), [half, 0.0, 0.05 * high]), ("side".into(), [0.4 * half, -0.5 * thick, 0.4 * high])],
        start: [[0.0; 3], [d.between(3.0, 7.0), 0.0, d.signed(2.0)]],
        pivot: Some([0.0, 0.0, held]),
        other_start: [[0.0; 3], [-9.0, 0.0, -3.0]],
        swings: true,
        stiff: (80.0, 300.0),
    }
}

fn block(d: &mut Draw, size: f64) -> Kind {
    let (half, high) = ([d.between(0.4, 0.6) * size, d.between(0.4, 0.6) * size], d.between(1.5, 2.2) * size);
    let clamp = 0.3 * size;
    let [x, y] = half;
    Kind {
        shape: format!("{{ box = {{ min = [{}, {}, 0], max = [{x}, {y}, {high}] }} }}", -x, -y),
        cell: d.between(0.4, 0.5) * size,
        support: format!("[[clamp]]\nbox = {{ min = [-1, -1, {}], max = [1, 1, {clamp}] }}\n", -size),
        center: [0.0, 0.0, 0.5 * high],
        markers: vec![("top".into(), [0.0, 0.0, high]), ("edge".into(), [x, 0.0, 0.8 * high])],
        start: [[d.signed(0.5), d.signed(0.3), 0.0], [0.0; 3]],
        pivot: Some([0.0, 0.0, clamp]),
        other_start: [[-0.4, 0.3, 0.0], [0.0; 3]],
        swings: true,
        stiff: (50.0, 200.0),
    }
}

fn blob(d: &mut Draw, r: f64) -> Kind {
    let (height, tilt) = (d.between(1.8, 2.4) * r, [d.signed(0.4), d.signed(0.4)]);
    Kind {
        shape: format!(
            "{{ cylinder = {{ radius = {r}, height = {height}, center = [0, 0, 0], axis = [{}, {}, 1] }} }}",
            tilt[0], tilt[1]
        ),
        cell: d.between(0.62, 0.72) * r,
        support: String::new(),
        center: [0.0, 0.0, 0.5 * r],
        markers: Vec::new(),
        start: [[d.signed(0.1), d.signed(0.1), 1.0], [d.signed(5.0), d.signed(5.0), d.between(3.0, 9.0)]],
        pivot: None,
        other_start: [[0.1, 0.0, 0.2], [0.0, 4.0, -3.0]],
        swings: false,
        stiff: (5.0, 40.0),
    }
}

fn ring(d: &mut Draw, size: f64) -> Kind {
    let (major, minor) = (size, d.between(0.38, 0.48) * size);
    let height = d.between(1.0, 1.2) * size;
    let lean = d.between(0.1, 0.4);
    Kind {
        shape: format!("{{ torus = {{ major = {major}, minor = {minor}, center = [0, 0, {height}], axis = [{lean}, 0, 1] }} }}"),
        cell: d.between(0.9, 1.05) * minor,
        support: "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n".into(),
        center: [0.0, 0.0, 0.6 * height],
        markers: Vec::new(),
        start: [[d.signed(0.2), 0.0, d.between(-0.4, 0.0)], [d.signed(2.0), 0.0, 0.0]],
        pivot: None,
        other_start: [[0.0, 0.1, -0.3], [0.5, 0.0, 0.0]],
        swings: false,
        stiff: (25.0, 100.0),
    }
}

impl Kind {
    fn setup(self, d: &mut Draw, kind: &str, number: u64, size: f64) -> Setup {
        let density = d.log(200.0, 1500.0);
        let modulus = density * 9.81 * size * d.log(self.stiff.0, self.stiff.1);
        let nu = d.between(0.25, 0.45);
        let (alpha, beta) = (d.between(0.1, 0.8), d.log(0.002, 0.008));
        let steps = d.between(18.0, 29.9) as usize;
        let step = d.between(0.008, 0.0125);
        let theta = d.one(&[0.5, 0.6, 0.6]);
        let body = format!(
            "format = \"scene/1\"\n[object]\nshape = {}\ncell_size = {}\n[material]\ndensity = {density}\nyoungs_modulus = {modulus}\n\
             poisson_ratio = {nu}\nmass_damping = {alpha}\nstiffness_damping = {beta}\n{}[time]\nstep = {step}\nsteps = {steps}\ntheta = {theta}\n",
            self.shape, self.cell, self.support
        );
        let mut fit = Setup::free("material.youngs_modulus", d.between(0.75, 1.3) * modulus);
        if self.swings && d.between(0.0, 1.0) < 0.6 {
            fit += &Setup::free("material.stiffness_damping", d.between(0.8, 1.3) * beta);
        } else if d.between(0.0, 1.0) < 0.3 {
            fit += &Setup::free("world.gravity.z", -9.6);
        }
        let mut camera = |angle: f64| {
            let (far, up) = (d.between(9.0, 12.0) * size, d.between(0.5, 4.0) * size);
            let pixels = d.one(&[22, 26, 30, 34]);
            let [x, y, z] = self.center;
            let eye = [x + far * angle.cos(), y + far * angle.sin(), z + up];
            let fov = d.between(24.0, 29.0);
            format!("eye={},{},{} target={x},{y},{z} fov={fov} size={pixels}x{pixels}", eye[0], eye[1], eye[2])
        };
        let first = -1.4;
        let (one, two) = (vec![camera(first)], vec![camera(first), camera(first + 1.5)]);
        let marked = !self.markers.is_empty();
        let (cameras, markers) = match d.one(&[0, 1, 2, 3]) {
            0 if marked => (Vec::new(), self.markers),
            1 => (two, Vec::new()),
            2 if marked => (one, self.markers),
            _ => (one, Vec::new()),
        };
        Setup {
            name: format!("{kind} {number}"),
            body,
            given: Vec::new(),
            fit,
            cameras,
            poses: Vec::new(),
            markers,
            spacing: step * d.one(&[1.0, 2.0, 2.5]),
            noise: size * d.log(0.003, 0.02),
            start: self.start,
            pivot: self.pivot,
            other_start: self.other_start,
        }
    }
}
