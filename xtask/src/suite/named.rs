//! The named scenes of the suite: tiny bodies that bend, bounce, slide, spin and swing, each with what it is watched by. Cells are as
//! coarse as the time step: finer ones would cost time and leave the larger of the two errors as it is.

use super::setup::Setup;
use super::short::{BETA, E, Short};

/// Noise of a depth reading and of a marker's coordinate [m]: a hundredth of the bodies' size.
const NOISE: f64 = 5e-4;

const BEAM: Short = Short {
    shape: "{ box = { min = [0, -0.015, 0.1], max = [0.2, 0.015, 0.13] } }",
    cell_size: 0.015,
    density: 1000.0,
    model: None,
    material: [4.0e5, 0.4, 0.3, 0.003],
    support: "[[clamp]]\nbox = { min = [-0.01, -0.03, 0.08], max = [0.025, 0.03, 0.15] }\n",
    given: &[],
    step: 0.01,
    steps: 32,
    theta: 0.6,
    free: &[(E, 3.2e5), (BETA, 0.004)],
    cameras: &["eye=0.13,-0.5,0.22 target=0.11,0,0.09 fov=26 size=32x32"],
    markers: &[("tip", [0.2, 0.0, 0.115]), ("top", [0.15, 0.0, 0.13]), ("half", [0.1, -0.015, 0.115])],
    spacing: 0.025,
    noise: NOISE,
    start: [[0.0; 3]; 2],
    pivot: Some([0.025, 0.0, 0.115]),
    other_start: [[0.0; 3], [0.0, -1.5, 0.0]],
};

const TORUS: Short = Short {
    shape: "{ torus = { major = 0.1, minor = 0.04, center = [0.001, 0.002, 0.11], axis = [0.35, 0, 1] } }",
    cell_size: 0.04,
    density: 100.0,
    model: None,
    material: [5000.0, 0.4, 0.1, 0.01],
    support: "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n",
    given: &[],
    step: 0.0125,
    steps: 28,
    theta: 0.6,
    free: &[(E, 4000.0), (BETA, 0.012)],
    cameras: &["eye=0.25,-0.7,0.45 target=0,0,0.06 fov=28 size=32x32"],
    markers: &[],
    spacing: 0.025,
    noise: NOISE,
    start: [[0.0; 3]; 2],
    pivot: None,
    other_start: [[0.0, 0.0, -0.35], [0.5, 0.0, 0.0]],
};

const BALL: Short = Short {
    shape: "{ ball = { radius = 0.05, center = [0, 0, 0.06] } }",
    cell_size: 0.034,
    density: 1000.0,
    model: None,
    material: [2.0e4, 0.4, 0.5, 0.004],
    support: "[[plane]]\npoint = [0, 0, 0]\nnormal = [0.25, 0, 1]\n",
    given: &[],
    step: 0.0125,
    steps: 24,
    theta: 0.6,
    free: &[(E, 1.6e4)],
    cameras: &["eye=0.15,-0.55,0.25 target=0.04,0,0.03 fov=28 size=36x36"],
    markers: &[],
    spacing: 0.025,
    noise: NOISE,
    start: [[0.0; 3]; 2],
    pivot: None,
    other_start: [[0.1, 0.05, -0.3], [0.0; 3]],
};

const BLOB: Short = Short {
    shape: "{ cylinder = { radius = 0.04, height = 0.08, center = [0, 0, 0.1], axis = [0.2, 0.1, 1] } }",
    cell_size: 0.027,
    density: 1000.0,
    model: None,
    material: [3000.0, 0.4, 0.3, 0.005],
    support: "",
    given: &[],
    step: 0.01,
    steps: 26,
    theta: 0.6,
    free: &[(E, 2400.0)],
    cameras: &["eye=0,-0.6,0.2 target=0,0,0.12 fov=24 size=26x26", "eye=0.5,0.3,0.3 target=0,0,0.12 fov=24 size=26x26"],
    markers: &[],
    spacing: 0.02,
    noise: NOISE,
    start: [[0.0, 0.0, 1.2], [3.0, 0.0, 9.0]],
    pivot: None,
    other_start: [[0.1, 0.0, 0.2], [0.0, 4.0, -3.0]],
};

const PLATE: Short = Short {
    shape: "{ box = { min = [-0.07, -0.01, 0], max = [0.07, 0.01, 0.13] } }",
    cell_size: 0.024,
    density: 1000.0,
    model: None,
    material: [1.0e5, 0.4, 0.3, 0.003],
    support: "[[clamp]]\nbox = { min = [-0.1, -0.03, 0.11], max = [0.1, 0.03, 0.15] }\n",
    given: &[],
    step: 0.01,
    steps: 32,
    theta: 0.6,
    free: &[(E, 8.0e4), (BETA, 0.004)],
    cameras: &["eye=0.1,-0.5,0.12 target=0,0,0.06 fov=24 size=26x26", "eye=-0.45,0.3,0.0 target=0,0,0.06 fov=24 size=26x26"],
    markers: &[("corner", [0.07, 0.0, 0.005]), ("side", [0.03, -0.01, 0.05])],
    spacing: 0.025,
    noise: NOISE,
    start: [[0.0; 3], [6.0, 0.0, 1.5]],
    pivot: Some([0.0, 0.0, 0.11]),
    other_start: [[0.0; 3], [-10.0, 0.0, -4.0]],
};

/// A pillow lands on a ramp: 46 × 46 × 15 cm, seven frames of one camera, and seven numbers free. Its friction is what is hidden.
const RAMP: Short = Short {
    shape: "{ box = { min = [-0.23, -0.23, 0.0], max = [0.23, 0.23, 0.15] } }",
    cell_size: 0.0575,
    density: 10.7,
    model: None,
    material: [3430.0, 0.3, 0.068, 0.02],
    // 22°: its normal leans along x; the pillow starts 12 cm above.
    support: "[[plane]]\npoint = [0, 0, -0.22]\nnormal = [0.374607, 0, 0.927184]\n",
    // Given: 20° and a centimetre and a half too high.
    given: &[(
        "point = [0, 0, -0.22]\nnormal = [0.374607, 0, 0.927184]",
        "point = [0, 0, -0.20226]\nnormal = [0.342898, 0, 0.939373]",
    )],
    step: 0.0083333333333333,
    steps: 72,
    theta: 0.6,
    free: &[
        (E, 2800.0),
        ("material.mass_damping", 0.1),
        (BETA, 0.025),
        ("world.gravity.z", -9.5),
        ("plane.0.height", -0.19),
        // Its tilt, from the slope that is given: the polar axis of a floor's normal is y, and the azimuth counts from z towards x.
        ("plane.0.phi", 0.349066),
    ],
    cameras: &["eye=0.5,-1.9,0.7 target=0.1,0,-0.15 fov=30 size=50x50"],
    markers: &[],
    spacing: 0.0833333333333333,
    noise: 3e-3,
    start: [[0.0; 3]; 2],
    pivot: None,
    other_start: [[0.3, 0.2, -0.4], [0.0, 0.6, 0.0]],
};

/// A spinning ball of 1400 nodes lands and is dragged round by friction, which is what is hidden: how long a larger body takes.
const BOULDER: Short = Short {
    shape: "{ ball = { radius = 0.06, center = [0, 0, 0.075] } }",
    cell_size: 0.0095,
    density: 500.0,
    model: None,
    material: [2.0e4, 0.4, 0.3, 0.004],
    support: "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n",
    given: &[],
    step: 0.005,
    steps: 74,
    theta: 0.6,
    free: &[(E, 1.6e4), (BETA, 0.005)],
    cameras: &["eye=0.15,-0.6,0.25 target=0.05,0,0.05 fov=28 size=36x36"],
    markers: &[],
    spacing: 0.025,
    noise: NOISE,
    start: [[0.3, 0.0, -0.3], [0.0, 15.0, 3.0]],
    pivot: None,
    other_start: [[0.0; 3]; 2],
};

/// The scene of this name.
pub fn setup(name: &str) -> Option<Setup> {
    let short = match name {
        "beam" => &BEAM,
        "torus" => &TORUS,
        "ball" => &BALL,
        "blob" => &BLOB,
        "plate" => &PLATE,
        "ramp" => &RAMP,
        "boulder" => &BOULDER,
        _ => return super::watched::setup(name),
    };
    Some(short.setup(name))
}
