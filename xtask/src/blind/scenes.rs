//! The five scenes of the blind suite: tiny bodies that bend, bounce, slide, spin and swing, each with what it is watched by. Cells are as
//! coarse as the time step: finer ones would cost time and leave the larger of the two errors as it is.

use glam::DVec3;
use palpate::Error;
use palpate::render::Pinhole;
use palpate_io::parse_scene;
use palpate_model::scene::Scene;
use std::path::Path;

/// Noise of a depth reading and of a marker's coordinate [m]: a hundredth of the bodies' size.
pub const NOISE: f64 = 5e-4;

/// Names of the scenes.
pub const NAMES: [&str; 5] = ["beam", "torus", "ball", "blob", "plate"];

/// A scene with its cameras and markers.
pub struct Setup {
    /// Name.
    pub name: &'static str,
    /// The scene file without observation and fit; its values are the true ones unless something is hidden.
    pub body: &'static str,
    /// What the diagnosis is free to fit from the start, as scene file.
    pub fit: &'static str,
    /// Cameras as on the command line.
    pub cameras: &'static [&'static str],
    /// Markers on the rest surface [m].
    pub markers: &'static [(&'static str, [f64; 3])],
    /// Frames are this far apart [s].
    pub spacing: f64,
    /// The start of the held-out recording: velocity [m/s] and angular velocity [rad/s] added.
    pub other_start: [[f64; 3]; 2],
}

const BEAM: Setup = Setup {
    name: "beam",
    body: r#"
format = "scene/1"
[object]
shape = { box = { min = [0, -0.015, 0.1], max = [0.2, 0.015, 0.13] } }
cell_size = 0.015
[material]
density = 1000.0
youngs_modulus = 4.0e5
poisson_ratio = 0.4
mass_damping = 0.3
stiffness_damping = 0.003
[[clamp]]
box = { min = [-0.01, -0.03, 0.08], max = [0.025, 0.03, 0.15] }
[time]
step = 0.01
steps = 50
"#,
    fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [3.2e5, 3.2e5]\n\
          [[fit.parameter]]\npath = \"material.stiffness_damping\"\nstart = [0.004, 0.004]\n",
    cameras: &["eye=0.13,-0.5,0.22 target=0.11,0,0.09 fov=26 size=40x40"],
    markers: &[("tip", [0.2, 0.0, 0.115]), ("top", [0.15, 0.0, 0.13]), ("half", [0.1, -0.015, 0.115])],
    spacing: 0.025,
    other_start: [[0.0, 0.0, 0.0], [0.0, -1.5, 0.0]],
};

const TORUS: Setup = Setup {
    name: "torus",
    body: r#"
format = "scene/1"
[object]
shape = { torus = { major = 0.1, minor = 0.04, center = [0.001, 0.002, 0.11], axis = [0.35, 0, 1] } }
cell_size = 0.032
[material]
density = 100.0
youngs_modulus = 5000.0
poisson_ratio = 0.4
mass_damping = 0.1
stiffness_damping = 0.01
[[plane]]
point = [0, 0, 0]
normal = [0, 0, 1]
[time]
step = 0.01
steps = 40
"#,
    fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [4000.0, 4000.0]\n\
          [[fit.parameter]]\npath = \"material.stiffness_damping\"\nstart = [0.012, 0.012]\n",
    cameras: &["eye=0.25,-0.7,0.45 target=0,0,0.06 fov=28 size=40x40"],
    markers: &[],
    spacing: 0.02,
    other_start: [[0.0, 0.0, -0.35], [0.5, 0.0, 0.0]],
};

const BALL: Setup = Setup {
    name: "ball",
    body: r#"
format = "scene/1"
[object]
shape = { ball = { radius = 0.05, center = [0, 0, 0.06] } }
cell_size = 0.024
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
mass_damping = 0.5
stiffness_damping = 0.002
[[plane]]
point = [0, 0, 0]
normal = [0.25, 0, 1]
[time]
step = 0.01
steps = 40
"#,
    fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.6e4, 1.6e4]\n",
    cameras: &["eye=0.15,-0.55,0.25 target=0.05,0,0.03 fov=28 size=40x40"],
    markers: &[],
    spacing: 0.02,
    other_start: [[0.1, 0.05, -0.3], [0.0, 0.0, 0.0]],
};

const BLOB: Setup = Setup {
    name: "blob",
    body: r#"
format = "scene/1"
[object]
shape = { cylinder = { radius = 0.04, height = 0.08, center = [0, 0, 0.1], axis = [0.2, 0.1, 1] } }
cell_size = 0.02
[material]
density = 1000.0
youngs_modulus = 3000.0
poisson_ratio = 0.4
mass_damping = 0.3
stiffness_damping = 0.005
[initial]
velocity = [0.0, 0.0, 1.2]
angular_velocity = [3.0, 0.0, 9.0]
[time]
step = 0.01
steps = 30
"#,
    fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [2400.0, 2400.0]\n",
    cameras: &["eye=0,-0.6,0.2 target=0,0,0.12 fov=24 size=32x32", "eye=0.5,0.3,0.3 target=0,0,0.12 fov=24 size=32x32"],
    markers: &[],
    spacing: 0.015,
    other_start: [[0.1, 0.0, 0.2], [0.0, 4.0, -3.0]],
};

const PLATE: Setup = Setup {
    name: "plate",
    body: r#"
format = "scene/1"
[object]
shape = { box = { min = [-0.07, -0.01, 0], max = [0.07, 0.01, 0.13] } }
cell_size = 0.019
[material]
density = 1000.0
youngs_modulus = 1.0e5
poisson_ratio = 0.4
mass_damping = 0.3
stiffness_damping = 0.003
[[clamp]]
box = { min = [-0.1, -0.03, 0.11], max = [0.1, 0.03, 0.15] }
[initial]
angular_velocity = [6.0, 0.0, 1.5]
pivot = [0, 0, 0.11]
[time]
step = 0.01
steps = 40
"#,
    fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [8.0e4, 8.0e4]\n\
          [[fit.parameter]]\npath = \"material.stiffness_damping\"\nstart = [0.004, 0.004]\n",
    cameras: &["eye=0.1,-0.5,0.12 target=0,0,0.06 fov=24 size=32x32", "eye=-0.45,0.3,0.0 target=0,0,0.06 fov=24 size=32x32"],
    markers: &[("corner", [0.07, 0.0, 0.005]), ("side", [0.03, -0.01, 0.05])],
    spacing: 0.02,
    other_start: [[0.0, 0.0, 0.0], [-10.0, 0.0, -4.0]],
};

/// The ball of the tests: a few coarse cells and half the frames, so that a case takes seconds. Not part of the suite.
const PEBBLE: Setup = Setup {
    name: "pebble",
    body: r#"
format = "scene/1"
[object]
shape = { ball = { radius = 0.05, center = [0, 0, 0.06] } }
cell_size = 0.034
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
mass_damping = 0.5
stiffness_damping = 0.004
[[plane]]
point = [0, 0, 0]
normal = [0.25, 0, 1]
[time]
step = 0.0125
steps = 24
"#,
    fit: BALL.fit,
    cameras: &["eye=0.15,-0.55,0.25 target=0.04,0,0.03 fov=28 size=36x36"],
    markers: &[],
    spacing: 0.025,
    other_start: BALL.other_start,
};

/// The scene of this name.
pub fn setup(name: &str) -> Option<&'static Setup> {
    [&BEAM, &TORUS, &BALL, &BLOB, &PLATE, &PEBBLE].into_iter().find(|s| s.name == name)
}

impl Setup {
    /// The true scene with nothing hidden; the held-out recording's when `other`.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn truth(&self, other: bool) -> Result<Scene, Error> {
        self.parse(self.body, other)
    }

    /// The scene file of the diagnosis, which compares with a recording in `folder`.
    pub fn text(&self, folder: &Path) -> String {
        let costs = [(self.cameras.is_empty(), "sparse-surface"), (self.markers.is_empty(), "markers")];
        let costs: Vec<&str> = costs.iter().filter(|c| !c.0).map(|c| c.1).collect();
        let seen = format!("[observation]\nrecording = {:?}\ncost = {costs:?}\n", folder.display().to_string());
        format!("{}{seen}{}", self.body, self.fit)
    }

    /// The scene of the diagnosis.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn parse(&self, text: &str, other: bool) -> Result<Scene, Error> {
        let mut scene = parse_scene(text, format!("{}.toml", self.name))?.value;
        if other {
            scene.initial.velocity += DVec3::from(self.other_start[0]);
            scene.initial.angular_velocity += DVec3::from(self.other_start[1]);
            scene.initial.pivot = scene.initial.pivot.or(scene.clamps.first().map(|c| c.max * DVec3::new(1.0, 0.0, 0.8)));
        }
        Ok(scene)
    }

    /// Its cameras.
    ///
    /// # Errors
    /// A camera's description is wrong.
    pub fn cameras(&self) -> Result<Vec<Pinhole>, Error> {
        let one = |(i, text): (usize, &&str)| {
            let c: Pinhole = text.parse().map_err(|e| Error::Input(format!("{}: {e}", self.name)))?;
            Ok(Pinhole { name: format!("cam{i}"), ..c })
        };
        self.cameras.iter().enumerate().map(one).collect()
    }

    /// Its markers.
    pub fn markers(&self) -> Vec<(String, DVec3)> {
        self.markers.iter().map(|(n, p)| (n.to_string(), DVec3::from(*p))).collect()
    }
}
