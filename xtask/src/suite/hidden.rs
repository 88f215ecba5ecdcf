//! What is hidden where: every effect of the library, and every group of numbers that a diagnosis may free, in at least two of the scenes.
//!
//! A line says the direction of an effect at unit amplitude, some typical size. The amplitude itself is found by
//! [`super::strength`], so that the effect moves readings by so many standard deviations after refitting as `benchmark/cases.toml` aims at.

use glam::DVec3;
use palpate::Error;
use palpate_model::effects::{ALL, Effect, Unstated, find};
use palpate_model::scene::{Object, Scene};
use palpate_model::shape::shape_of;

/// A key with one or three numbers.
type Key = (&'static str, &'static [f64]);

/// One effect in one scene.
#[derive(Clone, Copy, Debug)]
pub struct Hidden {
    /// Name: the effect's kind, or the group of numbers.
    pub name: &'static str,
    /// Scene.
    pub scene: &'static str,
    /// What grows with the amplitude, at amplitude one: keys of an effect, or paths of a scene's numbers.
    pub grows: &'static [Key],
    /// Keys of an effect that stay.
    pub stays: &'static [Key],
}

const fn h(name: &'static str, scene: &'static str, grows: &'static [Key], stays: &'static [Key]) -> Hidden {
    Hidden { name, scene, grows, stays }
}

/// Everything that is hidden.
pub const TABLE: &[Hidden] = &[
    h("coulomb-friction", "ball", &[("coefficient", &[0.1])], &[]),
    h("coulomb-friction", "torus", &[("coefficient", &[0.2])], &[]),
    h("adhesion", "ball", &[("pressure", &[1e3])], &[]),
    h("adhesion", "torus", &[("pressure", &[100.0])], &[("range", &[0.004])]),
    // A wall down the slope; a shelf below the falling beam. They come nearer with the amplitude.
    h("second-plane", "ball", &[("distance", &[0.07])], &[("stiffness", &[0.5]), ("normal", &[-0.979, 0.041, 0.199])]),
    h("second-plane", "beam", &[("distance", &[0.04])], &[("stiffness", &[0.5]), ("normal", &[0.071, 0.0, 0.997])]),
    h("contact-stiffness", "ball", &[("change", &[-0.3])], &[]),
    h("contact-stiffness", "torus", &[("change", &[-0.3])], &[]),
    h("contact-dissipation", "ball", &[("dissipation", &[0.5])], &[]),
    h("contact-dissipation", "torus", &[("dissipation", &[0.5])], &[]),
    h("plane-pose", "ball", &[("plane.0.height", &[0.003])], &[]),
    h("plane-pose", "torus", &[("plane.0.height", &[0.003])], &[]),
    h("uniform-force", "beam", &[("force", &[0.0, 800.0, 200.0])], &[]),
    h("uniform-force", "blob", &[("force", &[900.0, 300.0, 0.0])], &[]),
    h("gravity", "ball", &[("world.gravity", &[0.3, 0.3, -0.5])], &[]),
    h("gravity", "plate", &[("world.gravity", &[0.5, 1.5, 0.0])], &[]),
    h("point-mass", "beam", &[("mass", &[0.01])], &[("point", &[0.19, 0.0, 0.13])]),
    h("point-mass", "blob", &[("mass", &[0.01])], &[("point", &[0.035, 0.0, 0.12])]),
    h("tether", "beam", &[("stiffness", &[2.0])], &[("attachment", &[0.18, 0.0, 0.13]), ("anchor", &[0.15, 0.1, 0.2])]),
    h("tether", "plate", &[("stiffness", &[2.0])], &[("attachment", &[0.06, 0.0, 0.01]), ("anchor", &[0.1, -0.15, 0.0])]),
    h("air-drag", "blob", &[("coefficient", &[20.0])], &[]),
    h("air-drag", "ball", &[("coefficient", &[20.0])], &[]),
    h("stiffness-gradient", "beam", &[("slope", &[4.0, 0.0, 0.0])], &[]),
    h("stiffness-gradient", "blob", &[("slope", &[0.0, 5.0, 8.0])], &[]),
    h("two-part-stiffness", "beam", &[("ratio", &[-0.4])], &[("position", &[0.01]), ("direction", &[1.0, 0.0, 0.0])]),
    h("two-part-stiffness", "plate", &[("ratio", &[-0.4])], &[("position", &[0.0]), ("direction", &[1.0, 0.0, 0.2])]),
    h("inclusion", "beam", &[("ratio", &[-0.6])], &[("center", &[0.12, 0.0, 0.115]), ("radius", &[0.02])]),
    h("inclusion", "plate", &[("ratio", &[-0.6])], &[("center", &[0.04, 0.0, 0.08]), ("radius", &[0.025])]),
    h("stiffness-modes", "beam", &[("square", &[0.6, 0.0, 0.0])], &[]),
    h("stiffness-modes", "plate", &[("square", &[0.8, 0.0, 0.0])], &[]),
    h("density-gradient", "beam", &[("slope", &[3.0, 0.0, 0.0])], &[]),
    h("density-gradient", "plate", &[("slope", &[4.0, 0.0, 0.0])], &[]),
    h("density-inclusion", "beam", &[("ratio", &[0.5])], &[("center", &[0.13, 0.0, 0.115]), ("radius", &[0.02])]),
    h("density-inclusion", "blob", &[("ratio", &[0.5])], &[("center", &[0.02, 0.0, 0.12]), ("radius", &[0.02])]),
    h("strain-stiffening", "torus", &[("coefficient", &[10.0])], &[]),
    h("strain-stiffening", "ball", &[("coefficient", &[10.0])], &[]),
    h("transverse-anisotropy", "plate", &[("stiffness", &[0.5])], &[("fibre", &[1.0, 0.0, 1.0])]),
    h("transverse-anisotropy", "beam", &[("stiffness", &[0.5])], &[("fibre", &[1.0, 1.0, 0.0])]),
    h("power-law-viscosity", "beam", &[("coefficient", &[0.01])], &[]),
    h("power-law-viscosity", "plate", &[("coefficient", &[0.01])], &[]),
    h("structural-damping", "beam", &[("loss", &[0.1])], &[]),
    h("structural-damping", "plate", &[("loss", &[0.1])], &[]),
    h("creep", "beam", &[("fraction", &[0.2])], &[("time", &[0.2])]),
    h("creep", "plate", &[("fraction", &[0.2])], &[("time", &[0.2])]),
    h("poisson-ratio", "ball", &[("material.poisson_ratio", &[-0.1])], &[]),
    h("poisson-ratio", "torus", &[("material.poisson_ratio", &[-0.1])], &[]),
    h("mass-damping", "beam", &[("material.mass_damping", &[0.7])], &[]),
    h("mass-damping", "blob", &[("material.mass_damping", &[0.3])], &[]),
    h("stiffness-damping", "ball", &[("material.stiffness_damping", &[0.003])], &[]),
    h("stiffness-damping", "blob", &[("material.stiffness_damping", &[0.005])], &[]),
    h("rest-shape", "beam", &[("bend_x_to_z", &[0.6])], &[]),
    h("rest-shape", "plate", &[("bend_z_to_y", &[0.8])], &[]),
    h("initial-velocity", "ball", &[("initial.velocity", &[0.03, 0.05, 0.0])], &[]),
    h("initial-velocity", "blob", &[("initial.velocity", &[0.05, 0.03, 0.0])], &[]),
    h("initial-spin", "torus", &[("initial.angular_velocity", &[0.0, 0.8, 0.3])], &[]),
    h("initial-spin", "beam", &[("initial.angular_velocity", &[0.0, 0.0, 0.5])], &[]),
    h("compliant-clamp", "beam", &[("layer", &[0.005])], &[]),
    h("compliant-clamp", "plate", &[("layer", &[0.003])], &[]),
    h("clamp-slip", "beam", &[("turn", &[0.0, 0.02, 0.01])], &[]),
    h("clamp-slip", "plate", &[("drift", &[0.0, 0.02, 0.01])], &[]),
    h(
        "camera-pose",
        "torus",
        &[("translation", &[0.002, 0.0, 0.001]), ("rotation", &[0.0, 0.003, 0.003])],
        &[("camera", &[0.0])],
    ),
    h("camera-pose", "blob", &[("translation", &[0.002, 0.001, 0.0]), ("rotation", &[0.002, 0.0, 0.002])], &[("camera", &[1.0])]),
    h("time-offset", "ball", &[("offset", &[0.003])], &[]),
    h("time-offset", "plate", &[("offset", &[0.003])], &[]),
    h("depth-bias", "ball", &[("bias", &[0.002])], &[]),
    h("depth-bias", "blob", &[("bias", &[0.002])], &[]),
    h("depth-scale", "torus", &[("error", &[0.004])], &[]),
    h("depth-scale", "blob", &[("error", &[0.004])], &[]),
    h("depth-bias-part", "torus", &[("bias", &[0.004])], &[("direction", &[1.0, 0.0, 0.2])]),
    h("depth-bias-part", "plate", &[("bias", &[0.004])], &[("direction", &[1.0, 0.0, 0.0]), ("position", &[0.02, 0.0, 0.06])]),
    h("depth-along-ray", "torus", &[("blend", &[0.2])], &[]),
    h("depth-along-ray", "plate", &[("blend", &[0.2])], &[]),
    h("marker-offset", "beam", &[("offset", &[0.002, 0.002, 0.0])], &[("marker", &[1.0])]),
    h("marker-offset", "plate", &[("offset", &[0.002, 0.0, 0.002])], &[("marker", &[0.0])]),
    // Seeds count lines: what comes later stands at the end.
    h("clamp-edge", "beam", &[("shift", &[0.005])], &[]),
    h("clamp-edge", "plate", &[("shift", &[-0.004])], &[]),
    h(
        "camera-pose",
        "plate",
        &[("translation", &[0.002, 0.0, 0.001]), ("rotation", &[0.0, 0.003, 0.003])],
        &[("camera", &[0.0])],
    ),
    h("coulomb-friction", "ramp", &[("coefficient", &[0.25])], &[]),
    h("coulomb-friction", "boulder", &[("coefficient", &[0.3])], &[]),
];

/// Names that mean the same physics in these scenes, so that no data can tell them apart: a force on a homogeneous body is gravity,
/// frames stamped late are a release before time.
pub const SAME: [(&str, &str); 2] = [("uniform-force", "gravity"), ("time-offset", "release-time")];

/// True for two names of the same thing.
pub fn same(a: &str, b: &str) -> bool {
    a == b || SAME.contains(&(a, b)) || SAME.contains(&(b, a))
}

/// One hidden number: the end of its path, its true value, and what a scene that does not know it says.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// Path in the scene, or in the effect's table.
    pub path: String,
    /// Truth.
    pub truth: f64,
    /// Value of the scene without it.
    pub absent: f64,
    /// A change that matters.
    pub scale: f64,
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn path(key: &str, of: usize, axis: usize) -> String {
    if of == 3 { format!("{key}.{}", AXES[axis]) } else { key.to_string() }
}

impl Hidden {
    /// Puts it into a scene with this amplitude; the hidden numbers.
    ///
    /// # Errors
    /// The table names a key that does not exist, or a value is not allowed.
    pub fn apply(&self, scene: &mut Scene, amplitude: f64) -> Result<Vec<Number>, Error> {
        let mut out = Vec::new();
        let Some(law) = find(self.name) else {
            for (key, direction) in self.grows {
                for (axis, d) in direction.iter().enumerate() {
                    let v = number(key, axis).ok_or_else(|| unknown(self.name, key))?;
                    let absent = v(scene, 0.0);
                    let truth = v(scene, amplitude * d);
                    out.push(Number { path: path(key, direction.len(), axis), truth, absent, scale: d.abs().max(1e-9) });
                }
            }
            let scale = out.iter().map(|n| n.scale).fold(0.0, f64::max);
            out.iter_mut().for_each(|n| n.scale = scale);
            let m = &scene.material;
            if m.poisson_ratio <= -0.5 || m.mass_damping < 0.0 || m.stiffness_damping < 0.0 {
                return Err(Error::Input(format!("{}: amplitude {amplitude} is not allowed", self.name)));
            }
            return Ok(out);
        };
        let mut effect = Effect::absent(law);
        let all = self.grows.iter().map(|k| (k, amplitude)).chain(self.stays.iter().map(|k| (k, 1.0)));
        for ((key, direction), factor) in all {
            let first = ALL[law].params.iter().position(|p| p.key == *key).ok_or_else(|| unknown(self.name, key))?;
            for (axis, d) in direction.iter().enumerate() {
                let p = &ALL[law].params[first + axis];
                // A plane comes nearer the stronger it is.
                let v = if *key == "distance" { d / factor } else { factor * d };
                if !(p.lower..=p.upper).contains(&v) {
                    return Err(Error::Input(format!("{} {key} = {v} is not allowed", self.name)));
                }
                effect.values[first + axis] = Some(v);
                // The stiffness of a wall is a penalty that counts in cells: nothing to be found.
                if let (Unstated::Absent(absent), false) = (p.default, self.name == "second-plane") {
                    out.push(Number { path: path(key, direction.len(), axis), truth: v, absent, scale: p.typical });
                }
            }
        }
        if self.name == "second-plane" && cuts(&effect, &scene.object) {
            return Err(Error::Input(format!("amplitude {amplitude}: the plane would stand inside the body at rest")));
        }
        scene.effects.push(effect);
        Ok(out)
    }
}

/// True if a plane of this effect cuts the body at rest: no body starts within a wall.
fn cuts(effect: &Effect, object: &Object) -> bool {
    let shape = shape_of(object);
    let value = |key: &str, axis: usize| {
        effect.law().params.iter().position(|p| p.key == key).and_then(|s| effect.values[s + axis]).unwrap_or(0.0)
    };
    let normal = DVec3::from_array([0, 1, 2].map(|a| value("normal", a))).normalize();
    let (low, high) = shape.bounds();
    let surface = shape.surface(0.1 * (high - low).max_element());
    let along = |p: &DVec3| normal.dot(*p - 0.5 * (low + high));
    surface.vertices.iter().map(along).fold(f64::INFINITY, f64::min) < -value("distance", 0)
}

fn unknown(name: &str, key: &str) -> Error {
    Error::Input(format!("{name}: there is no \"{key}\""))
}

/// Adds to a number of a scene and returns the sum.
type Add = Box<dyn Fn(&mut Scene, f64) -> f64>;

fn number(path: &str, axis: usize) -> Option<Add> {
    fn add(x: &mut f64, by: f64) -> f64 {
        *x += by;
        *x
    }
    Some(match path {
        "world.gravity" => Box::new(move |s, d| add(&mut s.gravity[axis], d)),
        "initial.velocity" => Box::new(move |s, d| add(&mut s.initial.velocity[axis], d)),
        "initial.angular_velocity" => Box::new(move |s, d| add(&mut s.initial.angular_velocity[axis], d)),
        "material.poisson_ratio" => Box::new(|s, d| add(&mut s.material.poisson_ratio, d)),
        "material.mass_damping" => Box::new(|s, d| add(&mut s.material.mass_damping, d)),
        "material.stiffness_damping" => Box::new(|s, d| add(&mut s.material.stiffness_damping, d)),
        "plane.0.height" => Box::new(|s, d| {
            let p = &mut s.planes[0];
            p.point += d * p.normal;
            DVec3::dot(p.point, p.normal)
        }),
        _ => return None,
    })
}
