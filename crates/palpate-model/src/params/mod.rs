//! The one registry of parameters: path, unit, bounds and transform of every number that can be fitted.
//!
//! A parameter is the dotted path of a number in the scene file. [`Layout`] lists those of one scene in a fixed
//! order; a parameter vector θ has one entry per key, in SI units and in the declared (not the optimiser's) variable.

pub mod changes;
pub mod coefficients;
pub mod grips;

use crate::effects;

/// How an optimiser sees a parameter; the transforms themselves live in `palpate-fit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transform {
    /// Positive: fitted as its logarithm.
    Log,
    /// Between its bounds: fitted as a logit.
    Logit,
    /// Any real number: fitted as it is, divided by `ParamSpec::typical`.
    Linear,
    /// A change v of something relative to its size, above −1: fitted as the logarithm of the factor 1 + v, so that forty times less is
    /// as near as forty times more.
    Relative,
}

/// One fittable number of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ParamKey {
    /// Young's modulus.
    YoungsModulus,
    /// Poisson's ratio.
    PoissonRatio,
    /// Mass density.
    Density,
    /// Rayleigh damping, mass-proportional.
    MassDamping,
    /// Rayleigh damping, stiffness-proportional.
    StiffnessDamping,
    /// Component (0 to 2) of gravity.
    Gravity(u8),
    /// Component of the initial velocity.
    Velocity(u8),
    /// Component of the initial angular velocity.
    AngularVelocity(u8),
    /// Time of the initial state on the recording's clock.
    TimeStart,
    /// Distance of plane i from the origin along its normal.
    PlaneHeight(u16),
    /// Polar angle of the normal of plane i.
    PlaneTheta(u16),
    /// Azimuth of the normal of plane i.
    PlanePhi(u16),
    /// Mass of point mass i.
    PointMass(u16),
    /// Number `slot` of effect `effect` of the scene, which follows law `law` of [`effects::ALL`].
    Effect {
        /// Number of the effect in the scene.
        effect: u16,
        /// Place of its law in the table.
        law: u16,
        /// Place in the law's parameters.
        slot: u16,
    },
}

/// A unit as it stands behind a number: with a space, and nothing for plain numbers.
pub fn unit_behind(unit: &str) -> String {
    if unit == "1" || unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// What is known about a parameter before any scene is read.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamSpec {
    /// Which parameter.
    pub key: ParamKey,
    /// Path in the scene file; components of a vector carry `.x`, `.y`, `.z`.
    pub path: String,
    /// SI unit, `1` for none.
    pub unit: &'static str,
    /// How optimisers see it.
    pub transform: Transform,
    /// Smallest allowed value.
    pub lower: f64,
    /// Largest allowed value.
    pub upper: f64,
    /// A size at which the parameter matters (scale of steps for `Transform::Linear`).
    pub typical: f64,
    /// One sentence for `--help` and reports.
    pub doc: &'static str,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl ParamKey {
    /// The registry entry of this key. Bounds are physical limits; a scene may narrow them.
    pub fn spec(self) -> ParamSpec {
        use ParamKey::*;
        use Transform::*;
        let inf = f64::INFINITY;
        let (path, unit, transform, lower, upper, typical, doc) = match self {
            YoungsModulus => ("material.youngs_modulus".into(), "Pa", Log, 1e-3, 1e13, 1e5, "stiffness of the material"),
            // Above 0.4999 the condition number of the stiffness matrix passes 1e4 and forces lose digits.
            PoissonRatio => ("material.poisson_ratio".into(), "1", Logit, -0.5, 0.4999, 0.1, "sideways contraction over stretch"),
            Density => ("material.density".into(), "kg/m³", Log, 1e-3, 1e5, 1e3, "mass per volume"),
            MassDamping => ("material.mass_damping".into(), "1/s", Log, 1e-9, 1e6, 0.1, "Rayleigh damping of slow motion (drag)"),
            StiffnessDamping => {
                ("material.stiffness_damping".into(), "s", Log, 1e-12, 1e3, 1e-3, "Rayleigh damping of fast vibration")
            }
            Gravity(a) => (format!("world.gravity.{}", AXES[a as usize]), "m/s²", Linear, -inf, inf, 9.81, "gravity"),
            Velocity(a) => {
                (format!("initial.velocity.{}", AXES[a as usize]), "m/s", Linear, -inf, inf, 1.0, "velocity at the start")
            }
            AngularVelocity(a) => {
                (format!("initial.angular_velocity.{}", AXES[a as usize]), "rad/s", Linear, -inf, inf, 1.0, "spin at the start")
            }
            TimeStart => {
                ("time.start".into(), "s", Linear, -inf, inf, 0.01, "time of the initial state on the recording's clock")
            }
            PlaneHeight(i) => {
                (format!("plane.{i}.height"), "m", Linear, -inf, inf, 0.01, "distance of the plane along its normal")
            }
            PlaneTheta(i) => (format!("plane.{i}.theta"), "rad", Linear, -inf, inf, 0.1, "polar angle of the plane's normal"),
            PlanePhi(i) => (format!("plane.{i}.phi"), "rad", Linear, -inf, inf, 0.1, "azimuth of the plane's normal"),
            PointMass(i) => (format!("mass.{i}.mass"), "kg", Log, 1e-9, 1e6, 1e-2, "point mass fixed to the body"),
            Effect { effect, law, slot } => {
                let p = &effects::ALL[usize::from(law)].params[usize::from(slot)];
                let axis = p.axis.map_or_else(String::new, |a| format!(".{}", AXES[usize::from(a)]));
                (format!("effect.{effect}.{}{axis}", p.key), p.unit, p.transform, p.lower, p.upper, p.typical, p.doc)
            }
        };
        ParamSpec { key: self, path, unit, transform, lower, upper, typical, doc }
    }

    /// Path of the vector that this is a component of, if only the direction of that counts.
    pub fn direction(self) -> Option<String> {
        match self {
            ParamKey::Effect { effect, law, slot } => {
                let p = &effects::ALL[usize::from(law)].params[usize::from(slot)];
                p.is_direction().then(|| format!("effect.{effect}.{}", p.key))
            }
            _ => None,
        }
    }
}

/// The parameters of one scene in their fixed order; θ vectors are indexed by it.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Keys in the order of θ, shape `[P]`.
    pub keys: Vec<ParamKey>,
}

impl Layout {
    /// The layout of a scene with so many planes, point masses, and effects of these laws.
    pub fn new(planes: usize, masses: usize, laws: &[usize]) -> Layout {
        use ParamKey::*;
        let mut keys = vec![YoungsModulus, PoissonRatio, Density, MassDamping, StiffnessDamping];
        keys.extend((0..3).map(Gravity));
        keys.extend((0..3).map(Velocity));
        keys.extend((0..3).map(AngularVelocity));
        keys.push(TimeStart);
        for i in 0..planes as u16 {
            keys.extend([PlaneHeight(i), PlaneTheta(i), PlanePhi(i)]);
        }
        keys.extend((0..masses as u16).map(PointMass));
        for (i, &law) in laws.iter().enumerate() {
            let key = |slot: usize| Effect { effect: i as u16, law: law as u16, slot: slot as u16 };
            keys.extend((0..effects::ALL[law].params.len()).map(key));
        }
        Layout { keys }
    }

    /// The effects in their order: law, and the places of its numbers in θ.
    pub fn effects(&self) -> impl Iterator<Item = (&'static effects::Law, std::ops::Range<usize>)> + '_ {
        self.keys.iter().enumerate().filter_map(|(p, key)| match *key {
            ParamKey::Effect { law, slot: 0, .. } => {
                let law = &effects::ALL[usize::from(law)];
                Some((law, p..p + law.params.len()))
            }
            _ => None,
        })
    }

    /// Number of parameters P.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// True for a layout without parameters (never the case for a scene).
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Place of a key in θ; panics if this scene does not have it (a broken invariant of the caller).
    pub fn index(&self, key: ParamKey) -> usize {
        self.keys.iter().position(|k| *k == key).expect("parameter key belongs to this scene's layout")
    }

    /// Places in θ of a path: one for a number, three for a vector (`world.gravity`), none if unknown.
    pub fn resolve(&self, path: &str) -> Vec<usize> {
        let matches = |spec: &str| spec == path || spec.strip_prefix(path).is_some_and(|r| matches!(r, ".x" | ".y" | ".z"));
        (0..self.len()).filter(|&p| matches(&self.keys[p].spec().path)).collect()
    }
}
