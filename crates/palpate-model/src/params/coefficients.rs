//! θ decoded into the coefficients of the discrete equations, and the chain rule between both.
//!
//! A backend reads coefficients: numbers of the whole scene ([`Physics`]) and arrays on cells and nodes ([`Changes`]). Derivatives have the
//! same shape. [`Coefficients::along`] gives the coefficients' derivative along a direction dθ, which tangents use;
//! [`Coefficients::pull_back`] takes dJ/d(coefficients), which an adjoint sums over all steps in one pass a term, and makes dJ/dθ of it once
//! at the end. So neither costs more where a field has ten thousand numbers.

use super::changes::{self, Changes};
use crate::effects::Site;
use crate::params::ParamKey;
use crate::params::fields::Varied;
use crate::plan::{Physics, Plan};
use crate::scene::InitialShape;
use glam::DVec3;

/// The coefficients of one member, or a derivative of or by them.
#[derive(Clone, Debug)]
pub struct Coefficients {
    /// Numbers of the scene.
    pub physics: Physics,
    /// Arrays on cells and nodes; `None` where they are 1 or zero everywhere, of derivatives where they are zero.
    pub changes: Changes,
}

/// Coefficients that a gradient is wanted by; a term leaves out what only others need.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sought {
    /// Young's modulus, or anything that it varies by over the body or in time.
    pub modulus: bool,
    /// Poisson's ratio.
    pub poisson: bool,
    /// Density, or anything that it varies by.
    pub density: bool,
    /// Rayleigh damping of either kind: mass, stiffness or anything that it varies by.
    pub damping: [bool; 2],
    /// Numbers of the viscosity.
    pub viscosity: bool,
    /// Factors of the material's curves.
    pub curves: bool,
    /// Gravity.
    pub gravity: bool,
    /// Time of the start.
    pub start: bool,
    /// Height or angles of some plane.
    pub planes: bool,
    /// Some point mass.
    pub masses: bool,
    /// The stress-free shape.
    pub rest: bool,
    /// Numbers of each effect.
    pub effects: Vec<bool>,
}

impl Sought {
    /// What the parameters of a mask `[P]` act through.
    pub fn new(plan: &Plan, wanted: &[bool]) -> Sought {
        let mut s = Sought { effects: vec![false; plan.layout.effects().count()], ..Sought::default() };
        // It follows from everything else.
        s.rest = plan.initial == InitialShape::Given && wanted.contains(&true);
        for (key, _) in plan.layout.keys.iter().zip(wanted).filter(|(_, w)| **w) {
            match *key {
                ParamKey::YoungsModulus => s.modulus = true,
                ParamKey::PoissonRatio => s.poisson = true,
                ParamKey::Density => s.density = true,
                ParamKey::MassDamping => s.damping[0] = true,
                ParamKey::StiffnessDamping => s.damping[1] = true,
                ParamKey::Viscosity | ParamKey::ViscosityExponent => s.viscosity = true,
                ParamKey::StretchFactor(_) | ParamKey::VolumeFactor(_) => s.curves = true,
                ParamKey::Gravity(_) => s.gravity = true,
                ParamKey::Velocity(_) | ParamKey::AngularVelocity(_) => {}
                ParamKey::TimeStart => s.start = true,
                ParamKey::PlaneHeight(_) | ParamKey::PlaneTheta(_) | ParamKey::PlanePhi(_) => s.planes = true,
                ParamKey::PointMass(_) => s.masses = true,
                ParamKey::Effect { effect, law, .. } => {
                    s.effects[usize::from(effect)] = true;
                    match crate::effects::ALL[usize::from(law)].site {
                        Site::Modulus(_) | Site::Aging(_) => s.modulus = true,
                        Site::Density(_) => s.density = true,
                        Site::Rest(_) => s.rest = true,
                        _ => {}
                    }
                }
                ParamKey::Field { field, .. } => match plan.fields[usize::from(field)].varied {
                    Varied::Modulus => s.modulus = true,
                    Varied::Density => s.density = true,
                    Varied::Damping => s.damping[1] = true,
                },
            }
        }
        s
    }
}

impl Coefficients {
    /// Of a parameter vector `[P]`.
    pub fn new(plan: &Plan, theta: &[f64]) -> Coefficients {
        let physics = Physics::new(&plan.layout, theta);
        let changes = Changes::new(plan, &physics);
        Coefficients { physics, changes }
    }

    /// Derivative along a direction dθ `[P]`.
    pub fn along(&self, plan: &Plan, direction: &[f64]) -> Coefficients {
        let physics = Physics::new(&plan.layout, direction);
        let mut out = Changes::default();
        for (effect, rates) in physics.effects.iter().enumerate() {
            for (slot, rate) in rates.iter().enumerate().filter(|(_, r)| **r != 0.0) {
                if let Some(slope) = self.changes.modulus_slope(plan, &self.physics, effect, slot) {
                    add(&mut out.modulus, *rate, &slope);
                }
                if let Some(slope) = self.changes.density_slope(plan, &self.physics, effect, slot) {
                    add(&mut out.density, *rate, &slope);
                }
                if let Some(slope) = changes::rest_slope(plan, &self.physics, effect, slot) {
                    add(&mut out.rest, *rate, &slope);
                }
            }
        }
        for (field, (values, rates)) in plan.fields.iter().zip(self.physics.fields.iter().zip(&physics.fields)) {
            if rates.iter().any(|r| *r != 0.0) {
                let factors = self.changes.of(field.varied).unwrap_or_default();
                let ln = field.ln_along(values, rates);
                add(out.varied(field.varied), 1.0, &ln.iter().zip(factors).map(|(l, f)| l * f).collect::<Vec<_>>());
            }
        }
        Coefficients { physics, changes: out }
    }

    /// A gradient of zero with room for what is sought.
    pub fn zero_gradient(plan: &Plan, sought: &Sought) -> Coefficients {
        let (cells, nodes) = (plan.body.elements(), plan.body.nodes.len());
        let changes = Changes {
            modulus: sought.modulus.then(|| vec![0.0; cells]),
            density: sought.density.then(|| vec![0.0; nodes]),
            damping: sought.damping[1].then(|| vec![0.0; cells]),
            rest: sought.rest.then(|| vec![DVec3::ZERO; nodes]),
        };
        Coefficients { physics: Physics::new(&plan.layout, &vec![0.0; plan.layout.len()]), changes }
    }

    /// Adds to dJ/dθ `[P]` what follows from dJ/d(coefficients), `gradient`, for the parameters that are wanted.
    pub fn pull_back(&self, plan: &Plan, gradient: &Coefficients, wanted: &[bool], out: &mut [f64]) {
        let flat = gradient.physics.to_theta(&plan.layout);
        for ((o, g), _) in out.iter_mut().zip(flat).zip(wanted).filter(|(_, w)| **w) {
            *o += g;
        }
        for (places, (field, values)) in plan.layout.fields().zip(plan.fields.iter().zip(&self.physics.fields)) {
            let by_factor = gradient.changes.of(field.varied).zip(self.changes.of(field.varied));
            if let (Some((g, factors)), true) = (by_factor, wanted[places.clone()].iter().any(|w| *w)) {
                let by_ln: Vec<f64> = g.iter().zip(factors).map(|(g, f)| g * f).collect();
                let mut pulled = vec![0.0; field.count];
                field.pull(values, &by_ln, &mut pulled);
                let all = places.zip(pulled).filter(|(p, _)| wanted[*p]);
                all.for_each(|(p, g)| out[p] += g);
            }
        }
        let effects = self.physics.effects.iter().map(Vec::len).sum::<usize>();
        let first = plan.layout.effects().next().map_or(0, |(_, range)| range.start);
        for (p, key) in plan.layout.keys.iter().enumerate().skip(first).take(effects).filter(|(p, _)| wanted[*p]) {
            let ParamKey::Effect { effect, slot, .. } = *key else { continue };
            let (effect, slot) = (usize::from(effect), usize::from(slot));
            if let (Some(g), Some(slope)) =
                (&gradient.changes.modulus, self.changes.modulus_slope(plan, &self.physics, effect, slot))
            {
                out[p] += g.iter().zip(&slope).map(|(g, s)| g * s).sum::<f64>();
            }
            if let (Some(g), Some(slope)) =
                (&gradient.changes.density, self.changes.density_slope(plan, &self.physics, effect, slot))
            {
                out[p] += g.iter().zip(&slope).map(|(g, s)| g * s).sum::<f64>();
            }
            if let (Some(g), Some(slope)) = (&gradient.changes.rest, changes::rest_slope(plan, &self.physics, effect, slot)) {
                out[p] += g.iter().zip(&slope).map(|(g, s)| g.dot(*s)).sum::<f64>();
            }
        }
    }
}

/// sum += rate · slope.
fn add<T: Copy + std::ops::Mul<f64, Output = T> + std::ops::AddAssign + Default>(
    sum: &mut Option<Vec<T>>,
    rate: f64,
    slope: &[T],
) {
    let sum = sum.get_or_insert_with(|| vec![T::default(); slope.len()]);
    sum.iter_mut().zip(slope).for_each(|(a, s)| *a += *s * rate);
}
