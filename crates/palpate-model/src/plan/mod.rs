//! Everything a backend needs, and nothing else: below this line nobody reads the scene again.

pub mod build;
pub mod join;
pub mod jumps;
pub mod locking;
pub mod scheme;

pub use crate::cutcells::clamp_cell::ClampCell;
use crate::cutcells::clamp_edge::Edge;
use crate::effects::driven::DrivenSites;
use crate::effects::moving::Moving;
use crate::materials::Model;
use crate::materials::curve::Curve;
use crate::materials::principal_stretch::PrincipalStretch;
use crate::materials::viscosity::Viscosity;
use crate::mechanics::motion::RigidMotion;
use crate::mechanics::path::Path;
use crate::observation::{Observation, Recording, View, Viewed};
use crate::params::fields::Field;
use crate::params::{Layout, ParamKey};
use crate::scene::{InitialShape, Solver};
use crate::space::body::Body;
use crate::space::stencil::Stencils;
use glam::{DMat3, DVec3};
use scheme::{Scheme, Stage};
use std::sync::Arc;

/// A body that has moved this many times its own size has left the world.
pub const WORLD_SIZE: f64 = 1000.0;
/// Newton iterations that a static problem has at least: it starts far from its solution.
pub const STATIC_ITERATIONS: usize = 200;

/// A batch's common part: geometry, clock, recordings. Members differ in θ and in what of the recordings they are compared with.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The body.
    pub body: Arc<Body>,
    /// Material model.
    pub model: &'static Model,
    /// Corners of its curves; their factors are parameters.
    pub curves: PrincipalStretch,
    /// Order of θ.
    pub layout: Layout,
    /// The scene's own parameter values [P].
    pub theta: Vec<f64>,
    /// Contact planes.
    pub planes: Vec<PlaneSite>,
    /// Held regions.
    pub clamps: Vec<ClampSite>,
    /// Point masses.
    pub masses: Stencils,
    /// Fields on the body.
    pub fields: Vec<Field>,
    /// The path of every effect that follows one.
    pub followed: Vec<Option<Arc<Path>>>,
    /// Where the points of every effect that a series drives sit.
    pub driven: Vec<Option<Arc<DrivenSites>>>,
    /// What moves, of every effect that is a rigid thing beside the body.
    pub moving: Vec<Option<Arc<Moving>>>,
    /// How the body deforms at every patch of the surface, where some effect asks for normals that turn with it; else empty.
    pub frames: Arc<Stencils>,
    /// Time steps.
    pub clock: Clock,
    /// Times of all states of a quasi-static sequence on the recording's clock [s], rising; empty for a motion.
    pub times: Vec<f64>,
    /// Shape at the start.
    pub initial: InitialShape,
    /// Centre of the initial spin [m].
    pub pivot: DVec3,
    /// What was measured.
    pub observation: Arc<Observation>,
    /// Further recordings of the same body, which take no more steps.
    pub others: Vec<Recording>,
    /// Half width of the cost's band φ_max [m].
    pub band: f64,
    /// Numerical choices.
    pub solver: Solver,
}

impl Plan {
    /// All solves from the start to the end.
    pub fn stages(&self) -> Vec<Stage> {
        let mut all = self.clock.stages();
        for (stage, time) in all.iter_mut().zip(self.times.iter().skip(1)) {
            stage.time = time - self.times[0];
        }
        all
    }

    /// Number of recordings that members may be compared with.
    pub fn recordings(&self) -> usize {
        1 + self.others.len()
    }

    /// A recording, its own being the first.
    pub fn recording(&self, number: usize) -> Recording {
        match number.checked_sub(1) {
            None => Recording { observation: self.observation.clone(), steps: self.clock.steps },
            Some(other) => self.others[other].clone(),
        }
    }

    /// A view with its recording.
    pub fn viewed(&self, view: &View) -> Viewed {
        Viewed { recording: self.recording(view.recording), view: view.clone() }
    }

    /// The material's law for a member's numbers, where they make another of it than [`Model::law`].
    pub fn own_law(&self, physics: &Physics) -> Option<PrincipalStretch> {
        if !self.model.has_curves {
            return None;
        }
        let [stretch, volume] = [&self.curves.stretch, &self.curves.volume];
        let with = |curve: &Curve, factors: &Vec<f64>| Curve { stretches: curve.stretches.clone(), factors: factors.clone() };
        Some(PrincipalStretch { stretch: with(stretch, &physics.curves[0]), volume: with(volume, &physics.curves[1]) })
    }
}

/// A contact plane's constant part; height and angles are parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneSite {
    /// Axis (0 to 2) that θ is measured from: normal = cos θ e_p + sin θ (cos φ e_{p+1} + sin φ e_{p+2}).
    pub polar_axis: usize,
    /// Fixed penalty stiffness [Pa/m], or `None`: [`crate::mechanics::contact::DEFAULT_STIFFNESS`] · E / h.
    pub stiffness: Option<f64>,
}

/// A held region: per-cell weights of Nitsche's terms and of the held volume.
#[derive(Clone)]
pub struct ClampSite {
    /// Cells with surface or volume in the region, in increasing order.
    pub cells: Vec<ClampCell>,
    /// Held nodes and the stiffness of each one's spring [N/m], of bodies without cells.
    pub nodes: Vec<(u32, f64)>,
    /// Area of the held surface that each of them stands for, or a substitute within the body: what a compliant layer acts over [m²].
    pub areas: Vec<f64>,
    /// Prescribed motion; `None` = held still.
    pub motion: Option<RigidMotion>,
    /// What is held when an effect moves the region's edge.
    pub edge: Arc<Edge>,
}

impl std::fmt::Debug for ClampSite {
    /// Without the edge, which follows from the rest and the body.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("ClampSite").field("cells", &self.cells).field("nodes", &self.nodes).field("motion", &self.motion).finish()
    }
}

/// Time steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Length of a step [s].
    pub step: f64,
    /// Number of steps.
    pub steps: usize,
    /// Weight of the new state, where the scheme leaves it open.
    pub theta: f64,
    /// How a step is taken.
    pub scheme: &'static Scheme,
}

impl Clock {
    /// True where states follow from each other in time: neither a static problem nor a sequence of them.
    pub fn moves(&self) -> bool {
        self.steps > 0 && !self.scheme.still
    }

    /// All solves from the start to the end.
    pub fn stages(&self) -> Vec<Stage> {
        self.scheme.stages(self.step, self.steps, self.theta)
    }
}

/// One member's θ decoded into the numbers that passes use.
#[derive(Clone, Debug, PartialEq)]
pub struct Physics {
    /// Young's modulus [Pa].
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density [kg/m³].
    pub density: f64,
    /// Rayleigh damping [1/s].
    pub mass_damping: f64,
    /// Rayleigh damping [s].
    pub stiffness_damping: f64,
    /// The material's viscosity, where it has one.
    pub viscosity: Option<Viscosity>,
    /// Factors of the material's curves: along stretches, of the volume.
    pub curves: [Vec<f64>; 2],
    /// Gravity [m/s²].
    pub gravity: DVec3,
    /// Initial velocity [m/s].
    pub velocity: DVec3,
    /// Initial angular velocity [rad/s].
    pub angular_velocity: DVec3,
    /// Time of the initial state [s].
    pub start: f64,
    /// Per plane: height [m], θ, φ [rad].
    pub planes: Vec<[f64; 3]>,
    /// Point masses [kg].
    pub masses: Vec<f64>,
    /// Parameters of every effect.
    pub effects: Vec<Vec<f64>>,
    /// Values of every field.
    pub fields: Vec<Vec<f64>>,
}

impl Physics {
    /// Decodes a parameter vector `[P]`.
    pub fn new(layout: &Layout, theta: &[f64]) -> Physics {
        let get = |k| theta[layout.index(k)];
        let vec = |k: fn(u8) -> ParamKey| DVec3::new(get(k(0)), get(k(1)), get(k(2)));
        Physics {
            youngs_modulus: get(ParamKey::YoungsModulus),
            poisson_ratio: get(ParamKey::PoissonRatio),
            density: get(ParamKey::Density),
            mass_damping: get(ParamKey::MassDamping),
            stiffness_damping: get(ParamKey::StiffnessDamping),
            viscosity: layout
                .is_viscous()
                .then(|| Viscosity { coefficient: get(ParamKey::Viscosity), exponent: get(ParamKey::ViscosityExponent) }),
            curves: layout.curves().map(|range| theta[range].to_vec()),
            gravity: vec(ParamKey::Gravity),
            velocity: vec(ParamKey::Velocity),
            angular_velocity: vec(ParamKey::AngularVelocity),
            start: get(ParamKey::TimeStart),
            planes: (0..layout.planes() as u16)
                .map(|i| [get(ParamKey::PlaneHeight(i)), get(ParamKey::PlaneTheta(i)), get(ParamKey::PlanePhi(i))])
                .collect(),
            masses: (0..layout.masses() as u16).map(|i| get(ParamKey::PointMass(i))).collect(),
            effects: layout.effects().map(|(_, range)| theta[range].to_vec()).collect(),
            fields: layout.fields().map(|range| theta[range].to_vec()).collect(),
        }
    }

    /// The numbers as a parameter vector `[P]`: the inverse of [`Physics::new`].
    pub fn to_theta(&self, layout: &Layout) -> Vec<f64> {
        let value = |key: &ParamKey| match *key {
            ParamKey::YoungsModulus => self.youngs_modulus,
            ParamKey::PoissonRatio => self.poisson_ratio,
            ParamKey::Density => self.density,
            ParamKey::MassDamping => self.mass_damping,
            ParamKey::StiffnessDamping => self.stiffness_damping,
            ParamKey::Viscosity => self.viscosity.map_or(0.0, |v| v.coefficient),
            ParamKey::ViscosityExponent => self.viscosity.map_or(0.0, |v| v.exponent),
            ParamKey::StretchFactor(k) => self.curves[0][usize::from(k)],
            ParamKey::VolumeFactor(k) => self.curves[1][usize::from(k)],
            ParamKey::Gravity(a) => self.gravity[usize::from(a)],
            ParamKey::Velocity(a) => self.velocity[usize::from(a)],
            ParamKey::AngularVelocity(a) => self.angular_velocity[usize::from(a)],
            ParamKey::TimeStart => self.start,
            ParamKey::PlaneHeight(i) => self.planes[usize::from(i)][0],
            ParamKey::PlaneTheta(i) => self.planes[usize::from(i)][1],
            ParamKey::PlanePhi(i) => self.planes[usize::from(i)][2],
            ParamKey::PointMass(i) => self.masses[usize::from(i)],
            ParamKey::Effect { effect, slot, .. } => self.effects[usize::from(effect)][usize::from(slot)],
            ParamKey::Field { field, index } => self.fields[usize::from(field)][index as usize],
        };
        layout.keys.iter().map(value).collect()
    }
}

impl PlaneSite {
    /// The axis most across a normal, so that both angles are regular there (never parallel to the normal).
    pub fn polar_axis_for(normal: DVec3) -> usize {
        // Prefer z, the textbook's polar axis, unless the normal is within 45 degrees of it.
        if normal.z.abs() < 0.7 {
            2
        } else if normal.x.abs() <= normal.y.abs() {
            0
        } else {
            1
        }
    }

    /// Angles (θ, φ) [rad] of a unit normal.
    pub fn angles(&self, normal: DVec3) -> (f64, f64) {
        let p = self.polar_axis;
        (normal[p].clamp(-1.0, 1.0).acos(), normal[(p + 2) % 3].atan2(normal[(p + 1) % 3]))
    }

    /// Unit normal of angles (θ, φ) [rad] with its derivatives by θ and φ.
    pub fn normal(&self, theta: f64, phi: f64) -> [DVec3; 3] {
        let (st, ct) = theta.sin_cos();
        let (sp, cp) = phi.sin_cos();
        let p = self.polar_axis;
        let build = |a: f64, b: f64, c: f64| {
            let mut v = DVec3::ZERO;
            v[p] = a;
            v[(p + 1) % 3] = b;
            v[(p + 2) % 3] = c;
            v
        };
        [build(ct, st * cp, st * sp), build(-st, ct * cp, ct * sp), build(0.0, -st * sp, st * cp)]
    }
}

/// Rigid motion of a clamp at a time on the recording's clock: rotation and translation [m].
pub fn clamp_pose(motion: Option<&RigidMotion>, time: f64) -> (DMat3, DVec3) {
    motion.map_or((DMat3::IDENTITY, DVec3::ZERO), |m| m.at(time))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plane_angles_round_trip_and_derive() {
        for n in [DVec3::Z, DVec3::Y, DVec3::X, DVec3::new(0.3, -0.5, 0.9).normalize(), DVec3::new(-0.2, 0.9, 0.1).normalize()] {
            let site = PlaneSite { polar_axis: PlaneSite::polar_axis_for(n), stiffness: None };
            let (t, p) = site.angles(n);
            let [m, dt, dp] = site.normal(t, p);
            assert!((m - n).length() < 1e-14);
            let d = 1e-6;
            let ft = (site.normal(t + d, p)[0] - site.normal(t - d, p)[0]) / (2.0 * d);
            let fp = (site.normal(t, p + d)[0] - site.normal(t, p - d)[0]) / (2.0 * d);
            assert!((ft - dt).length() < 1e-9 && (fp - dp).length() < 1e-9);
            assert!(dt.length() > 0.5 && dp.length() > 0.5, "both angles turn the normal");
        }
    }
}
