//! What is hidden in which scene, what a diagnosis should call it, and its numbers where they are stated.

use glam::DVec3;

/// What the recorded body has and the scene does not know.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truth {
    /// Mass on the end face over that of the body.
    pub tip_mass: f64,
    /// Force per volume [N/m³].
    pub force: DVec3,
    /// Drag over dynamic pressure and whole surface.
    pub drag: f64,
    /// From this x on [m] the stiffness is this part of the scene's.
    pub soft: Option<(f64, f64)>,
    /// Curvature of the rest shape from x to z [1/m].
    pub bend: f64,
    /// Angular velocity at the start [rad/s].
    pub spin: DVec3,
    /// Friction on the ground.
    pub friction: f64,
    /// A magnet: its place, and its force per volume at 0.1 m [N/m³].
    pub magnet: Option<(DVec3, f64)>,
    /// Time that stamps are ahead by [s].
    pub clock: f64,
    /// Depth that readings are too large by [m].
    pub depth_bias: f64,
    /// Depth is measured along the pixels' rays.
    pub along_ray: bool,
    /// Stated minus true place of the camera [m], and the turn from its true to its stated pose [rad].
    pub camera: [DVec3; 2],
}

/// A case.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its name.
    pub name: &'static str,
    /// Name of its scene.
    pub scene: &'static str,
    /// What is hidden.
    pub truth: Truth,
    /// Names that are right; none where nothing, or nothing that has a name, is hidden.
    pub names: &'static [&'static str],
    /// Ends of the paths of numbers with their true values.
    pub numbers: &'static [(&'static str, f64)],
    /// True where all numbers may have the other sign: a body of two parts seen from the other one, a smooth ball that spins.
    pub mirrored: bool,
    /// The verdict that is right.
    pub verdict: &'static str,
}

fn case(scene: &'static str, name: &'static str, truth: Truth) -> Case {
    Case { name, scene, truth, names: &[], numbers: &[], mirrored: false, verdict: "missing-effect" }
}

impl Case {
    fn named(self, names: &'static [&'static str], numbers: &'static [(&'static str, f64)]) -> Case {
        Case { names, numbers, ..self }
    }
}

/// Every case.
pub fn all() -> Vec<Case> {
    let none = Truth::default();
    let (marked, seen, ball) = ("marked beam", "seen beam", "seen ball");
    let nothing = |scene, name| Case { verdict: "adequate", ..case(scene, name, none) };
    let soft = Truth { soft: Some((0.1, 0.4)), ..none };
    let heavy = Truth { tip_mass: 0.15, ..none };
    // The body weighs 180 g; ln 0.4 is −0.916.
    const HEAVY: &[(&str, f64)] = &[("mass", 0.027)];
    const TWO_PARTS: &[(&str, f64)] = &[("ratio", -0.916)];
    vec![
        nothing(marked, "nothing markers"),
        nothing(seen, "nothing camera"),
        nothing(ball, "nothing ball"),
        case(marked, "light tip mass markers", Truth { tip_mass: 0.03, ..none }).named(&["point-mass"], &[("mass", 0.0054)]),
        case(marked, "heavy tip mass markers", heavy).named(&["point-mass"], HEAVY),
        case(marked, "force markers", Truth { force: DVec3::new(0.0, 250.0, 0.0), ..none })
            .named(&["uniform-force", "gravity"], &[("force.x", 0.0), ("force.y", 250.0), ("force.z", 0.0)]),
        case(marked, "clock markers", Truth { clock: 0.015, ..none })
            .named(&["time-offset", "release-time"], &[("offset", 0.015)]),
        // Of 12 the free damping makes up for all but 0.2 mm.
        case(marked, "drag markers", Truth { drag: 50.0, ..none }).named(&["air-drag"], &[("coefficient", 50.0)]),
        Case { mirrored: true, ..case(marked, "two parts markers", soft).named(&["two-part-stiffness"], TWO_PARTS) },
        case(marked, "bent markers", Truth { bend: 0.6, ..none }).named(&["rest-shape"], &[("bend_x_to_z", 0.6)]),
        // The scene states 3.
        case(marked, "spin markers", Truth { spin: DVec3::new(0.0, 0.0, 1.0), ..none })
            .named(&["initial-spin"], &[("initial.angular_velocity.z", 4.0)]),
        case(seen, "depth bias camera", Truth { depth_bias: 0.01, ..none }).named(&["depth-bias"], &[("bias", 0.01)]),
        Case { mirrored: true, ..case(seen, "two parts camera", soft).named(&["two-part-stiffness"], TWO_PARTS) },
        case(seen, "heavy tip mass camera", heavy).named(&["point-mass"], HEAVY),
        case(seen, "pose camera", Truth { camera: [DVec3::new(0.004, 0.0, 0.0), DVec3::new(0.0, 0.006, 0.008)], ..none })
            .named(&["camera-pose"], &[("translation.x", 0.004), ("translation.y", 0.0), ("translation.z", 0.0)]),
        case(seen, "along ray camera", Truth { along_ray: true, ..none }).named(&["depth-along-ray"], &[("blend", 1.0)]),
        case(ball, "friction ball", Truth { friction: 0.4, ..none }).named(&["coulomb-friction"], &[("coefficient", 0.4)]),
        Case {
            mirrored: true,
            ..case(ball, "spin ball", Truth { spin: DVec3::new(0.0, 0.0, 20.0), ..none })
                .named(&["initial-spin"], &[("initial.angular_velocity.z", 20.0)])
        },
        case(ball, "drag ball", Truth { drag: 12.0, ..none }).named(&["air-drag"], &[("coefficient", 12.0)]),
        Case {
            verdict: "unexplained",
            ..case(ball, "magnet ball", Truth { magnet: Some((DVec3::new(0.15, 0.2, 0.1), 6e3)), ..none })
        },
    ]
}
