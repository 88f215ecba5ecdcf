//! What the diagnosis is given: the scenes of the independent cases, and their bodies as tetrahedra.

use super::super::scenes::Setup;
use super::body::Body;
use super::cases::Truth;
use super::loads::{Loads, Plane};
use super::material::Material;
use super::mesh::Mesh;
use glam::DVec3;
use palpate_model::scene::Scene;

/// Noise of a marker's coordinate [m].
pub const MARKER_NOISE: f64 = 3e-4;
/// Density of the air [kg/m³].
const AIR: f64 = 1.2;
/// Density of the bodies, as the scenes state it [kg/m³].
const DENSITY: f64 = 1000.0;
/// Penetration of the ground at a pressure of a quarter of Young's modulus [m].
const PENETRATION: f64 = 1e-4;

/// A scene, how it is seen, and what it is cut into.
pub struct Independent {
    /// Scene of the diagnosis, cameras, markers.
    pub setup: Setup,
    /// Noise of a depth reading [m].
    pub depth_noise: f64,
    /// Steps of the simulator in one of the scene.
    pub substeps: usize,
    /// The last frame is taken this long before the scene ends [s]: room for a clock that is off.
    pub spare: f64,
}

/// A beam that hangs at 30° from the vertical and swings in two planes. Let go where it is level, it strains by a fifth at its root: the best
/// fit then leaves 0.4 mm even where nothing is hidden, and half the step still 0.3 mm.
const BEAM: &str = r#"
format = "scene/1"
[object]
shape = { box = { min = [0, -0.015, 0.1], max = [0.2, 0.015, 0.13] } }
cell_size = 0.01
[material]
density = 1000.0
youngs_modulus = 2.4e5
poisson_ratio = 0.4
stiffness_damping = 0.003
[world]
gravity = [8.496, 0.0, -4.905]
[[clamp]]
box = { min = [-0.01, -0.03, 0.08], max = [0.02, 0.03, 0.15] }
[initial]
angular_velocity = [0.0, 0.0, 3.0]
pivot = [0.02, 0.0, 0.115]
[time]
step = 0.01
steps = 105
theta = 0.5
"#;

const BALL: &str = r#"
format = "scene/1"
[object]
shape = { ball = { radius = 0.05, center = [0, 0, 0.06] } }
cell_size = 0.0125
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
stiffness_damping = 0.002
[[plane]]
point = [0, 0, 0]
normal = [0.25, 0, 1]
[time]
step = 0.005
steps = 130
theta = 0.5
"#;

const BEAM_FIT: &str = "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.92e5, 1.92e5]\n\
                        [[fit.parameter]]\npath = \"material.stiffness_damping\"\nstart = [0.0036, 0.0036]\n";

const MARKED: Independent = Independent {
    setup: Setup {
        name: "marked beam",
        body: BEAM,
        fit: BEAM_FIT,
        cameras: &[],
        markers: &[
            ("tip", [0.2, 0.0, 0.115]),
            ("end", [0.19, 0.01, 0.13]),
            ("top", [0.15, -0.01, 0.13]),
            ("side", [0.12, -0.015, 0.11]),
            ("half", [0.1, 0.0, 0.13]),
            ("root", [0.06, -0.015, 0.12]),
        ],
        spacing: 0.02,
        other_start: [[0.0; 3], [0.0, -1.5, -5.0]],
    },
    depth_noise: 0.0,
    substeps: 8,
    spare: 0.04,
};

const SEEN: Independent = Independent {
    setup: Setup {
        name: "seen beam",
        cameras: &["eye=0.13,-0.5,0.22 target=0.11,0,0.06 fov=30 size=40x40"],
        markers: &[],
        spacing: 0.04,
        ..MARKED.setup
    },
    depth_noise: 3.5e-4,
    ..MARKED
};

const SEEN_BALL: Independent = Independent {
    setup: Setup {
        name: "seen ball",
        body: BALL,
        fit: "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.6e4, 1.6e4]\n",
        cameras: &["eye=0.15,-0.55,0.25 target=0.05,0,0.03 fov=28 size=40x40"],
        markers: &[],
        spacing: 0.025,
        other_start: [[0.1, 0.05, -0.3], [0.0; 3]],
    },
    depth_noise: 4.5e-4,
    substeps: 4,
    spare: 0.0,
};

/// The scene of this name.
pub fn scene(name: &str) -> Option<&'static Independent> {
    [&MARKED, &SEEN, &SEEN_BALL].into_iter().find(|s| s.setup.name == name)
}

/// Coordinates of the planes that cut the beam: finer where the clamp ends and strains change most.
const ALONG: [f64; 18] =
    [0.0, 0.02, 0.0225, 0.0265, 0.0325, 0.04, 0.05, 0.0625, 0.075, 0.0875, 0.1, 0.1125, 0.125, 0.14, 0.155, 0.17, 0.185, 0.2];

impl Independent {
    /// The mesh of the body as the scene states it.
    pub fn mesh(&self) -> Mesh {
        match self.setup.body {
            BALL => Mesh::ball(DVec3::new(0.0, 0.0, 0.06), 0.05, 3, 1),
            _ => Mesh::block([&ALONG, &[-0.015, 0.0, 0.015], &[0.1, 0.115, 0.13]]),
        }
    }

    /// The true body: that of the scene with something hidden.
    pub fn body(&self, scene: &Scene, truth: &Truth) -> Body {
        let mut mesh = self.mesh();
        let m = &scene.material;
        let held = |x: &DVec3| scene.clamps.iter().any(|c| x.cmpge(c.min - 1e-9).all() && x.cmple(c.max + 1e-9).all());
        let held = mesh.nodes.iter().map(held).collect();
        // Of the shape that the scene states: it says which part is which, also where the true one is bent.
        let soft: Vec<bool> = mesh.tets.iter().map(|t| truth.soft.is_some_and(|s| center(&mesh, t).x > s.0)).collect();
        let tip = mesh.nodes.iter().map(|x| x.x).fold(f64::NEG_INFINITY, f64::max);
        let material = Material::new(m.youngs_modulus, m.poisson_ratio);
        if truth.bend != 0.0 {
            let middle = scene.clamps.first().map_or(0.0, |c| 0.5 * (c.min.x.max(0.0) + c.max.x));
            mesh.nodes.iter_mut().for_each(|x| *x = bent(*x, DVec3::new(middle, 0.0, 0.115), truth.bend));
        }
        let mut body = Body::new(mesh, material, DENSITY);
        if truth.tip_mass > 0.0 {
            let mass = truth.tip_mass * body.total_mass();
            body.attach(mass, |corners| corners.iter().all(|c| c.x > tip - 1e-9));
        }
        (body.mass_damping, body.stiffness_damping) = (m.mass_damping, m.stiffness_damping);
        body.held = held;
        if let Some((_, factor)) = truth.soft {
            body.stiffness = soft.iter().map(|s| if *s { factor } else { 1.0 }).collect();
        }
        let plane = scene.planes.first().map(|p| Plane {
            normal: p.normal,
            height: p.point.dot(p.normal),
            stiffness: 0.25 * m.youngs_modulus / (PENETRATION * PENETRATION),
            friction: truth.friction,
        });
        body.loads =
            Loads { gravity: scene.gravity, force: truth.force, drag: 0.5 * AIR * truth.drag, magnet: truth.magnet, plane };
        body
    }
}

fn center(mesh: &Mesh, tet: &[usize; 10]) -> DVec3 {
    tet.iter().take(4).map(|n| mesh.nodes[*n]).sum::<DVec3>() / 4.0
}

/// A straight bar along x through `anchor`, bent there to an arc of this curvature towards z.
fn bent(x: DVec3, anchor: DVec3, curvature: f64) -> DVec3 {
    let d = x - anchor;
    let (angle, radius) = (curvature * d.x, 1.0 / curvature - d.z);
    anchor + DVec3::new(radius * angle.sin(), d.y, 1.0 / curvature - radius * angle.cos())
}
