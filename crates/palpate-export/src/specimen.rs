//! What is exported: a body with everything that a simulator may want to know of it. SI units.

use crate::mesh::Mesh;
use glam::DVec3;
use palpate_model::cutcells::cut::ClipBox;
use std::sync::Arc;

/// A place of the rest shape to its displacement there [m]; defined everywhere.
pub type Displacement<'a> = Arc<dyn Fn(DVec3) -> DVec3 + 'a>;

/// A body, its material and its world.
#[derive(Clone)]
pub struct Specimen<'a> {
    /// Name of files and of the body in them: letters, digits, `-` and `_`, a letter first.
    pub name: String,
    /// Free text of the scene.
    pub title: String,
    /// Where it comes from, and with which version.
    pub source: String,
    /// The stress-free shape.
    pub mesh: Mesh,
    /// The material; its modulus and density are those of the scene, which fields vary.
    pub material: Material,
    /// Young's modulus of every tetrahedron [Pa], where it varies.
    pub moduli: Option<Vec<f64>>,
    /// Density of every tetrahedron [kg/m³], where it varies.
    pub densities: Option<Vec<f64>>,
    /// What is held.
    pub held: Vec<Held>,
    /// Ground planes.
    pub planes: Vec<Ground>,
    /// Point masses.
    pub masses: Vec<PointMass>,
    /// Gravity [m/s²].
    pub gravity: DVec3,
    /// From the stress-free shape to the one at the start, where they differ.
    pub start: Option<Displacement<'a>>,
    /// Rigid velocity at the start, where it moves.
    pub spin: Option<Spin>,
    /// What is to be computed.
    pub clock: Clock,
    /// What no format has a place for: its key, and what it is.
    pub beyond: Vec<(String, String)>,
}

/// An isotropic material with Rayleigh damping.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name of its law in scenes.
    pub model: &'static str,
    /// Young's modulus [Pa].
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density [kg/m³].
    pub density: f64,
    /// Rayleigh α [1/s].
    pub mass_damping: f64,
    /// Rayleigh β [s].
    pub stiffness_damping: f64,
}

/// What a clamp holds.
#[derive(Clone, Debug)]
pub struct Held {
    /// Nodes of the mesh, increasing.
    pub nodes: Vec<u32>,
    /// The region in the world that it holds, for elements that have other nodes.
    pub region: ClipBox,
}

/// A half-space that the body cannot enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit normal, out of the forbidden half-space.
    pub normal: DVec3,
    /// Distance from the origin along it [m].
    pub height: f64,
    /// Pressure per penetration [Pa/m].
    pub stiffness: f64,
}

/// A point mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass {
    /// Place at rest [m].
    pub point: DVec3,
    /// Mass [kg].
    pub mass: f64,
}

/// A rigid velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spin {
    /// Velocity of the pivot [m/s].
    pub velocity: DVec3,
    /// Angular velocity [rad/s].
    pub angular: DVec3,
    /// The pivot [m].
    pub pivot: DVec3,
}

impl Spin {
    /// Velocity of a place [m/s].
    pub fn at(&self, x: DVec3) -> DVec3 {
        self.velocity + self.angular.cross(x - self.pivot)
    }
}

/// What is to be computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// The equilibrium.
    Static,
    /// A motion of so many steps [1] of so long [s].
    Motion {
        /// Length of a step [s].
        step: f64,
        /// Number of steps.
        steps: usize,
    },
}

impl Specimen<'_> {
    /// Density of a tetrahedron [kg/m³].
    pub fn density(&self, tet: usize) -> f64 {
        self.densities.as_ref().map_or(self.material.density, |d| d[tet])
    }

    /// Young's modulus of a tetrahedron [Pa].
    pub fn modulus(&self, tet: usize) -> f64 {
        self.moduli.as_ref().map_or(self.material.youngs_modulus, |e| e[tet])
    }

    /// Mass of the body without point masses [kg].
    pub fn mass(&self) -> f64 {
        (0..self.mesh.tets.len()).map(|e| self.density(e) * self.mesh.volume_of(e)).sum()
    }

    /// Nodes that some clamp holds, increasing.
    pub fn held_nodes(&self) -> Vec<u32> {
        let mut all: Vec<u32> = self.held.iter().flat_map(|h| h.nodes.iter().copied()).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Place of a node at the start [m].
    pub fn start_of(&self, x: DVec3) -> DVec3 {
        self.start.as_ref().map_or(x, |u| x + u(x))
    }

    /// Lumped mass of every corner node [kg]: a quarter of each tetrahedron, and each point mass at the corner that is nearest to it.
    pub fn corner_masses(&self) -> Vec<f64> {
        let mut masses = vec![0.0; self.mesh.corners];
        for (e, t) in self.mesh.tets.iter().enumerate() {
            let share = 0.25 * self.density(e) * self.mesh.volume_of(e);
            t.iter().for_each(|n| masses[*n as usize] += share);
        }
        for m in &self.masses {
            masses[nearest(&self.mesh.nodes[..self.mesh.corners], m.point)] += m.mass;
        }
        masses
    }

    /// How long a pressure wave takes through the body [s]: a step that resolves how it swings as a whole.
    pub fn passage(&self) -> f64 {
        let m = &self.material;
        let (e, nu) = (m.youngs_modulus, m.poisson_ratio);
        let modulus = e * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let (low, high) = self.mesh.bounds();
        (high - low).max_element() / (modulus / m.density).sqrt()
    }

    /// Tetrahedra by what they are made of: Young's modulus [Pa], density [kg/m³] and numbers of the tetrahedra. Where a field varies them, values
    /// within `STEP` of each other are one.
    pub fn parts(&self) -> Vec<(f64, f64, Vec<u32>)> {
        if self.moduli.is_none() && self.densities.is_none() {
            return vec![(self.material.youngs_modulus, self.material.density, (0..self.mesh.tets.len() as u32).collect())];
        }
        let rung = |value: f64, base: f64| ((value / base).ln() / STEP.ln_1p()).round() as i64;
        let m = &self.material;
        let mut parts = std::collections::BTreeMap::<(i64, i64), Vec<u32>>::new();
        for e in 0..self.mesh.tets.len() {
            let key = (rung(self.modulus(e), m.youngs_modulus), rung(self.density(e), m.density));
            parts.entry(key).or_default().push(e as u32);
        }
        let value = |rung: i64, base: f64| base * (STEP.ln_1p() * rung as f64).exp();
        parts.into_iter().map(|((e, d), tets)| (value(e, m.youngs_modulus), value(d, m.density), tets)).collect()
    }
}

/// Step of moduli and densities where a file has a material for each: half a step is less than any fit knows them to.
pub const STEP: f64 = 0.01;

/// Number of the place that is nearest; 0 without any.
fn nearest(places: &[DVec3], x: DVec3) -> usize {
    let best = places.iter().enumerate().min_by(|a, b| a.1.distance_squared(x).total_cmp(&b.1.distance_squared(x)));
    best.map_or(0, |b| b.0)
}
