//! Laws that change what the body is made of or held by: numbers at a place of the rest configuration, as functions of parameters.
//!
//! A law is written once for any number type and gives M numbers at a [`Spot`]; M and their meaning belong to its site
//! ([`super::Site`]). They are the same at every step but for the time that has passed, so backends evaluate them once.

use super::law::{Number, dot};
use glam::DVec3;
use num_dual::HyperDual64;

/// Where a field is evaluated; no derivative is taken by it.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    /// Rest position [m].
    pub rest: DVec3,
    /// The body's centre of mass at rest [m].
    pub center: DVec3,
    /// What the body hangs by: the middle of the first clamp, or the centre of mass of a body that nothing holds [m].
    pub anchor: DVec3,
    /// Half the longest edge of the body's box [m].
    pub size: f64,
    /// Edge of a cell [m]: no field can change faster than that.
    pub cell: f64,
    /// Time since the start of the simulation [s].
    pub elapsed: f64,
}

impl Spot {
    /// Rest position from the body's centre [m].
    pub fn from_center<D: Number>(&self) -> [D; 3] {
        (self.rest - self.center).to_array().map(D::from)
    }

    /// Rest position from a place given by three parameters [m].
    pub fn from_place<D: Number>(&self, place: &[D]) -> [D; 3] {
        let x = self.rest.to_array();
        [D::from(x[0]) - place[0], D::from(x[1]) - place[1], D::from(x[2]) - place[2]]
    }
}

/// A field of M numbers. Implement this; derivatives follow.
pub trait FieldLaw<const M: usize>: Sync {
    /// The numbers at a spot for parameters `[K]`.
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; M];
}

/// A [`FieldLaw`] with its derivatives, without its type.
pub trait Field<const M: usize>: Sync {
    /// The numbers at a spot.
    fn at(&self, spot: &Spot, p: &[f64]) -> [f64; M];
    /// Their derivatives by parameter i.
    fn slope(&self, spot: &Spot, p: &[f64], i: usize) -> [f64; M];
}

impl<const M: usize, L: FieldLaw<M>> Field<M> for L {
    fn at(&self, spot: &Spot, p: &[f64]) -> [f64; M] {
        self.values(spot, p)
    }

    fn slope(&self, spot: &Spot, p: &[f64], i: usize) -> [f64; M] {
        let mut lifted: Vec<HyperDual64> = p.iter().map(|v| HyperDual64::from(*v)).collect();
        lifted[i].eps1 = 1.0;
        self.values(spot, &lifted).map(|v| v.eps1)
    }
}

/// Smooth step from 0 to 1 over about ± half a cell around 0: a sharp one would stand still while its place moves between the points where
/// cells ask for it, and a wider one makes bodies of two parts that were simulated sharply 2 % more different than they are.
pub fn step<D: Number>(distance: D, cell: f64) -> D {
    ((distance * (2.0 / cell)).tanh() + 1.0) * 0.5
}

/// Smooth blob with a flat top: 1 in the middle, 1/e at the radius. `from` is the way from its middle [m].
pub fn blob<D: Number>(from: [D; 3], radius: D) -> D {
    let r = dot(from, from) / (radius * radius);
    (-(r * r)).exp()
}

/// Distance along a direction of any length [m].
pub fn along<D: Number>(from: [D; 3], direction: [D; 3]) -> D {
    dot(from, direction) / dot(direction, direction).sqrt()
}
