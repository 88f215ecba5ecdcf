//! The one registry of parameters: path, unit, bounds and transform of every number that can be fitted.
//!
//! A parameter is the dotted path of a number in the scene file. [`Layout`] lists those of one scene in a fixed
//! order; a parameter vector θ has one entry per key, in SI units and in the declared (not the optimiser's) variable.

pub mod changes;
pub mod coefficients;
pub mod fields;
pub mod grips;

use crate::effects;
use crate::materials::curve::Curve;
use crate::scene::Scene;

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
        /// Number of its table in the scene file among those of one name ([`effects::Law::table`]).
        row: u16,
    },
    /// Coefficient η of the material's viscosity.
    Viscosity,
    /// Its exponent h.
    ViscosityExponent,
    /// Factor at a corner of the curve of the stiffness along a stretch.
    StretchFactor(u8),
    /// Factor at a corner of the curve of the volume's stiffness.
    VolumeFactor(u8),
    /// Value `index` of field `field` of the scene.
    Field {
        /// Number of the field in the scene.
        field: u16,
        /// Number of the cell, node or region.
        index: u32,
    },
}

/// What a parameter lives on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    /// The whole scene.
    Scene,
    /// Plane i.
    Plane(u16),
    /// Point mass i.
    Mass(u16),
    /// Effect i.
    Effect(u16),
    /// The cells, nodes or regions of field i.
    Field(u16),
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

impl ParamSpec {
    /// A change that matters where the parameter has this value: of what is fitted by its logarithm, or within bounds, the value itself.
    pub fn size_at(&self, value: f64) -> f64 {
        match self.transform {
            _ if matches!(self.key, ParamKey::Effect { .. }) => self.typical,
            Transform::Linear => self.typical.min(1.0),
            _ => value,
        }
    }
}

/// True for what may follow a path to be a part of what it names: nothing, an axis, or the number of a corner.
pub fn is_component(rest: &str) -> bool {
    matches!(rest, "" | ".x" | ".y" | ".z") || rest.strip_prefix('.').is_some_and(|k| k.parse::<u8>().is_ok())
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
            // Honey in slow motion to a stiff putty; below h = 0.1 the stress no longer depends on the rate.
            Viscosity => {
                ("material.viscosity.coefficient".into(), "Pa·s^h", Log, 1e-9, 1e9, 1.0, "viscosity at a shear rate of 1/s")
            }
            ViscosityExponent => {
                ("material.viscosity.exponent".into(), "1", Log, 0.1, 3.0, 1.0, "power of the shear rate in the viscous stress")
            }
            // A thousand times: from a foam's plateau to what is left when it is closed.
            StretchFactor(k) => (
                format!("material.stretch_curve.factors.{k}"),
                "1",
                Log,
                1e-3,
                1e3,
                1.0,
                "stiffness along a stretch, over that at rest",
            ),
            VolumeFactor(k) => (
                format!("material.volume_curve.factors.{k}"),
                "1",
                Log,
                1e-3,
                1e3,
                1.0,
                "stiffness of the volume, over that at rest",
            ),
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
            Effect { law, slot, row, .. } => {
                let law = &effects::ALL[usize::from(law)];
                let p = &law.params[usize::from(slot)];
                let axis = p.axis.map_or_else(String::new, |a| format!(".{}", AXES[usize::from(a)]));
                (format!("{}.{row}.{}{axis}", law.table(), p.key), p.unit, p.transform, p.lower, p.upper, p.typical, p.doc)
            }
            // Beyond a factor of a million the matrix loses its digits.
            Field { field, index } => {
                (format!("field.{field}.{index}"), "1", Log, 1e-6, 1e6, 1.0, "factor of a field at one of its places")
            }
        };
        ParamSpec { key: self, path, unit, transform, lower, upper, typical, doc }
    }

    /// What it lives on.
    pub fn on(self) -> On {
        use ParamKey::*;
        match self {
            PlaneHeight(i) | PlaneTheta(i) | PlanePhi(i) => On::Plane(i),
            PointMass(i) => On::Mass(i),
            Effect { effect, .. } => On::Effect(effect),
            Field { field, .. } => On::Field(field),
            _ => On::Scene,
        }
    }

    /// Path of the vector that this is a component of, if only the direction of that counts.
    pub fn direction(self) -> Option<String> {
        match self {
            ParamKey::Effect { law, slot, row, .. } => {
                let law = &effects::ALL[usize::from(law)];
                let p = &law.params[usize::from(slot)];
                p.is_direction().then(|| format!("{}.{row}.{}", law.table(), p.key))
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
    /// Where planes, point masses, effects and fields begin; the last entry of each is its end.
    planes: usize,
    masses: usize,
    effects: Vec<usize>,
    fields: Vec<usize>,
    /// Place of the viscosity's numbers, where there is one.
    viscosity: Option<usize>,
    /// Where the factors of the curves begin: along stretches, of the volume; and their end.
    curves: [usize; 3],
}

/// Places of the numbers that every scene has, in their order.
const OF_EVERY_SCENE: usize = 15;

impl Layout {
    /// The layout of a scene with so many planes, point masses, effects of these laws, and fields of so many values.
    pub fn new(planes: usize, masses: usize, laws: &[usize], fields: &[usize]) -> Layout {
        use ParamKey::*;
        let mut keys = vec![YoungsModulus, PoissonRatio, Density, MassDamping, StiffnessDamping];
        keys.extend((0..3).map(Gravity));
        keys.extend((0..3).map(Velocity));
        keys.extend((0..3).map(AngularVelocity));
        keys.push(TimeStart);
        debug_assert_eq!(keys.len(), OF_EVERY_SCENE);
        let first_plane = keys.len();
        for i in 0..planes as u16 {
            keys.extend([PlaneHeight(i), PlaneTheta(i), PlanePhi(i)]);
        }
        let first_mass = keys.len();
        keys.extend((0..masses as u16).map(PointMass));
        let mut effects = vec![keys.len()];
        for (i, &law) in laws.iter().enumerate() {
            let table = |law: usize| effects::ALL[law].table();
            let row = laws[..i].iter().filter(|l| table(**l) == table(law)).count();
            let key = |slot: usize| Effect { effect: i as u16, law: law as u16, slot: slot as u16, row: row as u16 };
            keys.extend((0..effects::ALL[law].params.len()).map(key));
            effects.push(keys.len());
        }
        let mut starts = vec![keys.len()];
        for (i, &count) in fields.iter().enumerate() {
            keys.extend((0..count as u32).map(|index| Field { field: i as u16, index }));
            starts.push(keys.len());
        }
        Layout { keys, planes: first_plane, masses: first_mass, effects, fields: starts, viscosity: None, curves: [0; 3] }
    }

    /// The same with the numbers that only some materials have, at the end.
    pub fn with_material(mut self, scene: &Scene) -> Layout {
        if scene.material.viscosity.is_some() {
            self.viscosity = Some(self.keys.len());
            self.keys.extend([ParamKey::Viscosity, ParamKey::ViscosityExponent]);
        }
        let corners = |curve: &Curve| 0..curve.factors.len() as u8;
        let first = self.keys.len();
        self.keys.extend(corners(&scene.curves.stretch).map(ParamKey::StretchFactor));
        let second = self.keys.len();
        self.keys.extend(corners(&scene.curves.volume).map(ParamKey::VolumeFactor));
        self.curves = [first, second, self.keys.len()];
        self
    }

    /// Places in θ of the factors of the material's curves: along stretches, of the volume.
    pub fn curves(&self) -> [std::ops::Range<usize>; 2] {
        let [first, second, end] = self.curves;
        [first..second, second..end]
    }

    /// True where the material has a viscosity.
    pub fn is_viscous(&self) -> bool {
        self.viscosity.is_some()
    }

    /// The effects in their order: law, and the places of its numbers in θ.
    pub fn effects(&self) -> impl Iterator<Item = (&'static effects::Law, std::ops::Range<usize>)> + '_ {
        self.effects.windows(2).filter_map(|w| match self.keys.get(w[0]) {
            Some(ParamKey::Effect { law, .. }) => Some((&effects::ALL[usize::from(*law)], w[0]..w[1])),
            _ => None,
        })
    }

    /// The key of number `slot` of effect `effect`.
    pub fn effect_key(&self, effect: usize, slot: usize) -> ParamKey {
        self.keys[self.effects[effect] + slot]
    }

    /// Places in θ of the values of every field.
    pub fn fields(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        self.fields.windows(2).map(|w| w[0]..w[1])
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        (self.masses - self.planes) / 3
    }

    /// Number of point masses.
    pub fn masses(&self) -> usize {
        self.effects[0] - self.masses
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
        use ParamKey::*;
        let place = match key {
            YoungsModulus => 0,
            PoissonRatio => 1,
            Density => 2,
            MassDamping => 3,
            StiffnessDamping => 4,
            Gravity(a) => 5 + usize::from(a),
            Velocity(a) => 8 + usize::from(a),
            AngularVelocity(a) => 11 + usize::from(a),
            TimeStart => OF_EVERY_SCENE - 1,
            PlaneHeight(i) => self.planes + 3 * usize::from(i),
            PlaneTheta(i) => self.planes + 3 * usize::from(i) + 1,
            PlanePhi(i) => self.planes + 3 * usize::from(i) + 2,
            PointMass(i) => self.masses + usize::from(i),
            Effect { effect, slot, .. } => self.effects[usize::from(effect)] + usize::from(slot),
            Field { field, index } => self.fields[usize::from(field)] + index as usize,
            Viscosity => self.viscosity.unwrap_or(usize::MAX),
            ViscosityExponent => self.viscosity.map_or(usize::MAX, |first| first + 1),
            StretchFactor(k) => self.curves[0] + usize::from(k),
            VolumeFactor(k) => self.curves[1] + usize::from(k),
        };
        assert!(self.keys.get(place) == Some(&key), "parameter key {key:?} belongs to this scene's layout");
        place
    }

    /// Places in θ of a path: one for a number, three for a vector (`world.gravity`), all of a field (`field.0`), none if unknown.
    pub fn resolve(&self, path: &str) -> std::ops::Range<usize> {
        if let Some(rest) = path.strip_prefix("field.") {
            let mut parts = rest.split('.').map(str::parse::<usize>);
            let (Some(Ok(field)), index) = (parts.next(), parts.next()) else { return 0..0 };
            let Some(all) = self.fields().nth(field) else { return 0..0 };
            return match index {
                None => all,
                Some(Ok(k)) if k < all.len() && parts.next().is_none() => all.start + k..all.start + k + 1,
                Some(_) => 0..0,
            };
        }
        let matches = |spec: &str| spec.strip_prefix(path).is_some_and(is_component);
        let last = self.fields[self.fields.len() - 1];
        let mut found = (0..self.fields[0]).chain(last..self.keys.len()).filter(|&p| matches(&self.keys[p].spec().path));
        found.next().map_or(0..0, |first| first..found.next_back().unwrap_or(first) + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_has_its_place_and_every_path_finds_it() {
        let law = |kind| effects::find(kind).expect("it is in the table");
        let mixed = Layout::new(0, 0, &[law("wind"), law("file-load"), law("attachment"), law("tether"), law("file-load")], &[]);
        let first = |effect: usize| mixed.effect_key(effect, 0).spec().path;
        assert_eq!(first(1), "load.0.factor");
        assert_eq!([first(2), first(4)], ["attach.0.stiffness", "load.1.factor"]);
        assert!(first(3).starts_with("effect.1.") && mixed.resolve("attach.0.offset").len() == 3);
        let layout = Layout::new(2, 1, &[0, 5, 1], &[4, 1]);
        assert_eq!((layout.planes(), layout.masses()), (2, 1));
        for (p, key) in layout.keys.iter().enumerate() {
            assert_eq!(layout.index(*key), p);
            assert_eq!(layout.resolve(&key.spec().path), p..p + 1, "{}", key.spec().path);
        }
        assert_eq!(layout.resolve("world.gravity"), 5..8);
        let end = layout.len();
        assert_eq!((layout.resolve("field.0"), layout.resolve("field.1")), (end - 5..end - 1, end - 1..end));
        for unknown in ["field.2", "field.0.4", "field.x", "material", "plane.2.height", "field.0.1.2"] {
            assert!(layout.resolve(unknown).is_empty(), "{unknown}");
        }
    }
}
