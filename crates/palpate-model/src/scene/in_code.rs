//! Scenes that are built in code, from the fewest parts.

use super::*;

impl Scene {
    /// A body at rest in free space, and of everything else what a scene file that says no more gets.
    pub fn at_rest(path: impl Into<PathBuf>, object: Object, material: Material) -> Scene {
        Scene {
            path: path.into(),
            title: String::new(),
            object,
            material,
            gravity: DVec3::ZERO,
            clamps: Vec::new(),
            planes: Vec::new(),
            masses: Vec::new(),
            effects: Vec::new(),
            fields: Vec::new(),
            initial: Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state: InitialShape::Rest },
            time: Time::default(),
            solver: Solver::default(),
            observation: None,
            fit: None,
        }
    }
}

impl Material {
    /// An undamped body of the default law: Young's modulus [Pa], Poisson's ratio, 1000 kg/m³.
    pub fn undamped(youngs_modulus: f64, poisson_ratio: f64) -> Material {
        Material {
            model: &crate::materials::ALL[0],
            inertia: Inertia::Density(1000.0),
            youngs_modulus,
            poisson_ratio,
            mass_damping: 0.0,
            stiffness_damping: 0.0,
        }
    }
}

impl Clamp {
    /// A box of the world that is held still.
    pub fn still(min: DVec3, max: DVec3) -> Clamp {
        Clamp { min, max, object_frame: false, motion: None, motion_path: None }
    }
}
