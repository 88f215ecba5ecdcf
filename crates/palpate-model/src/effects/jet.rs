//! A round jet of air from a nozzle that moves as a file says (Chen et al., *Virtual Elastic Objects*, CVPR 2022, move toys so).
//!
//! Far behind a nozzle a turbulent jet has forgotten all but its thrust T. Its velocity at a distance s along the axis from the virtual origin
//! and r across it is u = u_c exp(−r²/b²) along the axis, with b = spread · s and u_c = √(2T/(πρ))/b (Pope, *Turbulent Flows*, 2000,
//! section 5.1, with a Gaussian profile). So its momentum flux ∫ ρu² dA is T at every s, and the air's density ρ cancels from every force.
//! What meets a wall leaves along it: a patch of area vector a = |a| n feels −ρ (u·n)² a where it faces the jet, u·n < 0, and is seen from the nozzle.
//! A plate across the jet feels T; a sphere in an even stream has a drag coefficient of one.

use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

/// Kind of this law.
pub const KIND: &str = "jet";

/// Slots of its numbers.
pub const THRUST: usize = 0;
/// Slot of the spread.
pub const SPREAD: usize = 1;
/// First slot of the offset.
pub const OFFSET: usize = 2;
/// Radii b of the jet out to which it blows: e⁻³² of its pressure is left there, so that no gradient sees the edge.
pub const REACH: f64 = 4.0;
/// Most pixels along a side of the picture that a nozzle has of the body.
pub const SIDE: usize = 1024;
/// Least cosine between a patch and the jet by which its slope is reckoned: what is steeper feels a hundredth of the pressure.
pub const STEEPEST: f64 = 0.1;
/// Numbers of the law.
pub const COUNT: usize = 5;

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Load,
    sentence: "a jet of air blows on the body",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Jet,
};

const ORIGIN: &str = "place of the jet's virtual origin in the nozzle's own coordinates";

const PARAMS: [EffectParam; COUNT] = [
    number("thrust", "N", [0.0, 1e6, 0.1], Unstated::Absent(0.0), "momentum that the jet carries each second"),
    number(
        "spread",
        "1",
        [1e-3, 10.0, 0.1],
        Unstated::Stated(0.1),
        "growth of the jet's radius b along its axis; 0.1 in still air",
    ),
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 0, "m", 1e-3, ORIGIN) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 1, "m", 1e-3, ORIGIN) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 2, "m", 1e-3, ORIGIN) },
];

/// What a jet's force on a patch depends on, or a change of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Meeting {
    /// From the virtual origin to the patch [m].
    pub way: DVec3,
    /// Area vector of the patch [m²], outward.
    pub area: DVec3,
    /// Unit vector that the jet blows along.
    pub axis: DVec3,
    /// Thrust [N].
    pub thrust: f64,
    /// Spread.
    pub spread: f64,
}

/// A force with its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Blown {
    /// Force on the patch [N].
    pub force: DVec3,
    at: Meeting,
    /// 2T/(πb²) exp(−2r²/b²): dynamic pressure of the air times two [Pa].
    pressure: f64,
    /// s and b [m].
    sizes: [f64; 2],
    /// axis · area [m²].
    through: f64,
}

impl Blown {
    /// The force of a jet; none where the patch looks away from it or lies behind its origin.
    pub fn new(at: Meeting) -> Option<Blown> {
        let (s, through) = (at.way.dot(at.axis), at.axis.dot(at.area));
        if s <= 0.0 || through >= 0.0 {
            return None;
        }
        let b = at.spread * s;
        let across = at.way.length_squared() - s * s;
        let pressure = 2.0 / (std::f64::consts::PI * b * b) * (-2.0 * across / (b * b)).exp() * at.thrust;
        let force = -pressure * through * through / at.area.length_squared() * at.area;
        Some(Blown { force, at, pressure, sizes: [s, b], through })
    }

    /// Derivatives of the logarithm of the pressure over the thrust by way, axis and spread.
    fn slopes(&self) -> (DVec3, DVec3, f64) {
        let ([s, b], Meeting { way, axis, spread, .. }) = (self.sizes, self.at);
        // ln q = −2 ln b − 2 (|w|² − s²)/b², b = spread s, s = w·axis.
        let across = way.length_squared() - s * s;
        let by_b = -2.0 / b + 4.0 * across / (b * b * b);
        let by_s = by_b * spread + 4.0 * s / (b * b);
        (axis * by_s - way * (4.0 / (b * b)), way * by_s, by_b * s)
    }

    /// Change of the force for a change of what it depends on.
    pub fn along(&self, d: &Meeting) -> DVec3 {
        let (by_way, by_axis, by_spread) = self.slopes();
        let size = self.at.area.length_squared();
        let (unit, area) = (self.unit(), self.at.area);
        let louder = by_way.dot(d.way) + by_axis.dot(d.axis) + by_spread * d.spread;
        let through = d.axis.dot(area) + self.at.axis.dot(d.area);
        let shape = (2.0 * self.through * through - 2.0 * self.through * self.through * area.dot(d.area) / size) / size;
        self.force * louder + d.thrust * unit - self.pressure * (shape * area + self.through * self.through / size * d.area)
    }

    /// Its transpose, for a derivative `w` by the force.
    pub fn pull(&self, w: DVec3) -> Meeting {
        let (by_way, by_axis, by_spread) = self.slopes();
        let (size, area, t) = (self.at.area.length_squared(), self.at.area, self.through);
        let (work, shape) = (w.dot(self.force), -self.pressure * w.dot(area) / size);
        let axis = self.at.axis;
        Meeting {
            way: work * by_way,
            area: shape * (2.0 * t * axis - 2.0 * t * t / size * area) - self.pressure * t * t / size * w,
            axis: work * by_axis + shape * 2.0 * t * area,
            thrust: w.dot(self.unit()),
            spread: work * by_spread,
        }
    }

    /// Force for a thrust of 1 N.
    fn unit(&self) -> DVec3 {
        // Without a thrust the force has a derivative by it all the same.
        let one = Meeting { thrust: 1.0, ..self.at };
        Blown::new(one).map_or(DVec3::ZERO, |b| b.force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rotation::tests::Noise;

    fn random(noise: &mut Noise) -> Meeting {
        let axis = noise.vector(1.0).normalize();
        let way = axis * noise.uniform(0.1, 0.3) + noise.vector(0.02);
        let area = (noise.vector(0.5) - axis) * 1e-4;
        Meeting { way, area, axis, thrust: noise.uniform(0.1, 0.3), spread: noise.uniform(0.08, 0.2) }
    }

    fn plus(a: &Meeting, s: f64, d: &Meeting) -> Meeting {
        Meeting {
            way: a.way + s * d.way,
            area: a.area + s * d.area,
            axis: a.axis + s * d.axis,
            thrust: a.thrust + s * d.thrust,
            spread: a.spread + s * d.spread,
        }
    }

    #[test]
    fn derivatives_match_differences_and_their_transpose() {
        let mut noise = Noise(11);
        for _ in 0..200 {
            let at = random(&mut noise);
            let d = Meeting {
                way: noise.vector(0.1),
                area: noise.vector(1e-4),
                axis: noise.vector(0.3),
                thrust: noise.uniform(-1.0, 1.0),
                spread: noise.uniform(-0.1, 0.1),
            };
            let (Some(blown), step) = (Blown::new(at), 1e-6) else { panic!("it faces the jet") };
            let force = |s: f64| Blown::new(plus(&at, s, &d)).map_or(DVec3::ZERO, |b| b.force);
            let along = blown.along(&d);
            // Truncation of 1e-12 of a third derivative of 1e3, rounding of 1e-10.
            assert!(
                ((force(step) - force(-step)) / (2.0 * step) - along).length() < 1e-7 * (blown.force.length() + along.length())
            );
            let (w, back) = (noise.vector(1.0), 0.0);
            let pulled = blown.pull(w);
            let product = pulled.way.dot(d.way) + pulled.area.dot(d.area) + pulled.axis.dot(d.axis) + back;
            let product = product + pulled.thrust * d.thrust + pulled.spread * d.spread;
            assert!((product - w.dot(along)).abs() < 1e-12 * (blown.force.length() + along.length()));
        }
    }

    #[test]
    fn it_carries_its_thrust_and_does_nothing_behind_itself() {
        // A plate across it in rings, 0.2 m from the origin.
        let (s, spread, rings) = (0.2, 0.1, 4000);
        let mut sum = 0.0;
        for k in 0..rings {
            // Out to 4 b, where e^-32 is left.
            let width = 4.0 * spread * s / f64::from(rings);
            let r = (f64::from(k) + 0.5) * width;
            let area = -DVec3::Z * (std::f64::consts::TAU * r * width);
            let at = Meeting { way: DVec3::new(r, 0.0, s), area, axis: DVec3::Z, thrust: 0.15, spread };
            sum += Blown::new(at).map_or(0.0, |b| b.force.z);
        }
        // Midpoints err by a 24th of (width/b)², 4e-8.
        assert!((sum - 0.15).abs() < 1e-6 * 0.15, "{sum}");
        let at = Meeting { way: DVec3::Z, area: -DVec3::Z, axis: DVec3::Z, thrust: 1.0, spread };
        assert!(Blown::new(at).is_some());
        assert!(Blown::new(Meeting { area: DVec3::Z, ..at }).is_none() && Blown::new(Meeting { way: -DVec3::Z, ..at }).is_none());
    }
}
