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
            curves: PrincipalStretch::default(),
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
            targets: Vec::new(),
            synthesis: Synthesis::default(),
            tracking: Tracking::default(),
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
            viscosity: None,
        }
    }
}

impl Clamp {
    /// A box of the world that is held still.
    pub fn still(min: DVec3, max: DVec3) -> Clamp {
        Clamp { region: ClampRegion::Box { min, max, object_frame: false }, motion: None, motion_path: None }
    }

    /// A named group of nodes of a volume mesh that is held still.
    pub fn group(name: &str) -> Clamp {
        Clamp { region: ClampRegion::Group(name.into()), motion: None, motion_path: None }
    }

    /// Lowest and highest corner of its box [m], where it has one.
    pub fn corners(&self) -> Option<(DVec3, DVec3)> {
        match self.region {
            ClampRegion::Box { min, max, .. } => Some((min, max)),
            ClampRegion::Group(_) => None,
        }
    }

    /// The same with its box in the mesh's own coordinates.
    pub fn in_object_frame(mut self) -> Clamp {
        if let ClampRegion::Box { object_frame, .. } = &mut self.region {
            *object_frame = true;
        }
        self
    }

    /// The same, moved.
    pub fn moved(self, motion: Option<RigidMotion>) -> Clamp {
        Clamp { motion, ..self }
    }
}
