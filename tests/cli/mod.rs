//! The command line as its users meet it: arguments in, exit code, text and files out.

mod batch;
mod carrying;
mod effects;
mod export;
mod fields;
mod fitting;
mod placing;
mod reporting;
mod synthesis;
mod tets;
mod tracking;
mod usage;

use support::command::{arg, succeed};

/// A soft ball held at its bottom that is pushed sideways at the start.
pub const BALL: &str = r#"
format = "scene/1"
title = "Pushed ball"

[object]
shape = { ball = { radius = 0.04, center = [0.02, 0.02, 0.04] } }
cell_size = 0.02

[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
mass_damping = 1.0

[[clamp]]
box = { min = [-0.1, -0.1, -0.01], max = [0.1, 0.1, 0.015] }

[initial]
velocity = [0.6, 0.0, 0.0]

[time]
step = 0.01
steps = 16
"#;

/// A soft block standing on a clamp that is pushed sideways at the start; small enough for a fit in a second.
pub const BLOCK: &str = r#"
format = "scene/1"
title = "Pushed block"

[object]
shape = { box = { min = [0, 0, 0], max = [0.04, 0.04, 0.08] } }
cell_size = 0.02

[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
mass_damping = 1.0

[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.05, 0.05, 0.001] }

[initial]
velocity = [0.6, 0.0, 0.0]

[time]
step = 0.01
steps = 16
"#;

/// What turns [`BALL`] or [`BLOCK`] into a fit of its stiffness to a recording beside it.
pub const STIFFNESS: &str = r#"
[observation]
recording = "seen"
cost = "sparse-surface"

[fit]
optimizer = "gauss-newton"
iterations = 12
starts = 3
seed = 4

[[fit.parameter]]
path = "material.youngs_modulus"
start = [8.0e3, 6.0e4]
bounds = [1.0e2, 1.0e7]
"#;

/// Watches either from the front.
pub const CAMERA: &str = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=80x60";

/// A folder with `scene.toml`, its recording `seen`, and `fit.toml` with another stiffness.
pub fn observed(scene: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("scene.toml"), scene).unwrap();
    std::fs::write(file("fit.toml"), scene.replace("2.0e4", "1.0e4") + STIFFNESS).unwrap();
    let (scene, seen) = (file("scene.toml"), file("seen"));
    succeed(&["observe", arg(&scene), "--camera", CAMERA, "--noise", "0.0005", "--depth-scale", "0.0001", "--out", arg(&seen)]);
    folder
}
