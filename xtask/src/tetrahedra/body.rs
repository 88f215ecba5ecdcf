//! A body in one step: the energy whose minimum is the next state, with its first and second derivatives.

use super::element::Elements;
use super::loads::{Contact, Loads};
use super::material::{Material, Tangent, green};
use super::mesh::Mesh;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// A body with what acts on it.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its mesh at rest.
    pub mesh: Mesh,
    /// Shape functions and quadrature.
    pub elements: Elements,
    /// What it is made of.
    pub material: Material,
    /// Stiffness of every tetrahedron over that of the material.
    pub stiffness: Vec<f64>,
    /// ∫ ρ N_i N_j of every tetrahedron [kg], with what is attached to it.
    pub mass: Vec<[[f64; 10]; 10]>,
    /// Damping proportional to mass [1/s].
    pub mass_damping: f64,
    /// Damping proportional to stiffness [s].
    pub stiffness_damping: f64,
    /// Nodes that do not move.
    pub held: Vec<bool>,
    /// What acts on it.
    pub loads: Loads,
    /// Forces on nodes [N]; empty for none.
    pub forces: Vec<DVec3>,
    /// Length of every tetrahedron without stress over that at rest; empty for one.
    pub growth: Vec<f64>,
    /// Where held nodes are, from their places at rest [m].
    pub offset: DVec3,
}

/// How the rates of a step follow from its new state: rate = `rate` · (new − before).
#[derive(Clone, Debug)]
pub struct Motion {
    /// [1/s]; 0 for a body at rest.
    pub rate: f64,
    /// Length of the step [s].
    pub step: f64,
    /// Displacements at the step's start [m].
    pub old: Vec<DVec3>,
    /// Displacements that rates count from [m].
    pub before: Vec<DVec3>,
    /// Velocities that accelerations count from [m/s].
    pub before_velocity: Vec<DVec3>,
    /// Green's strains that their rates count from.
    pub before_strain: Vec<[DMat3; 4]>,
    /// Pressures that friction counts with [Pa]; empty for none.
    pub pressures: Vec<[f64; 6]>,
}

/// Energy, gradient and blocks on and above the diagonal of one tetrahedron.
type Local = (f64, [DVec3; 10], Vec<DMat3>);

/// Place of a block on or above the diagonal among all of them, row by row.
fn place(a: usize, b: usize) -> usize {
    a * 10 - a * (a + 1) / 2 + b
}

impl Body {
    /// A body of one material that nothing acts on.
    pub fn new(mesh: Mesh, material: Material, density: f64) -> Body {
        let elements = Elements::new(&mesh);
        Body {
            material,
            stiffness: vec![1.0; mesh.tets.len()],
            mass: elements.products.iter().map(|p| p.map(|row| row.map(|x| density * x))).collect(),
            mass_damping: 0.0,
            stiffness_damping: 0.0,
            held: vec![false; mesh.nodes.len()],
            loads: Loads::default(),
            forces: Vec::new(),
            growth: Vec::new(),
            offset: DVec3::ZERO,
            mesh,
            elements,
        }
    }

    /// Spreads a mass [kg] over the faces that `on` chooses by their corners.
    pub fn attach(&mut self, mass: f64, on: impl Fn([DVec3; 3]) -> bool) {
        let chosen = |f: &&[usize; 6]| on([0, 1, 2].map(|k| self.mesh.nodes[f[k]]));
        let faces: Vec<usize> = self.mesh.faces.iter().enumerate().filter(|(_, f)| chosen(f)).map(|(k, _)| k).collect();
        let area: f64 = faces.iter().flat_map(|f| &self.elements.patches[*f]).map(|p| p.1).sum();
        for f in faces {
            let owner = self.mesh.owners[f];
            let tet = &self.mesh.tets[owner];
            let local = self.mesh.faces[f].map(|n| tet.iter().position(|m| *m == n).unwrap_or(0));
            for (shape, a) in &self.elements.patches[f] {
                for (i, p) in local.iter().zip(shape) {
                    for (j, q) in local.iter().zip(shape) {
                        self.mass[owner][*i][*j] += mass * a / area * p * q;
                    }
                }
            }
        }
    }

    /// Mass [kg].
    pub fn total_mass(&self) -> f64 {
        self.mass.iter().flatten().flatten().sum()
    }

    /// Green's strains at displacements.
    pub fn strains(&self, u: &[DVec3]) -> Vec<[DMat3; 4]> {
        let places = |t: &[usize; 10]| t.map(|n| self.mesh.nodes[n] + u[n]);
        let of = |k: usize| {
            let (x, grown) = (places(&self.mesh.tets[k]), self.grown(k));
            self.elements.points[k].map(|p| green(p.gradient(&x) * (1.0 / grown)))
        };
        (0..self.mesh.tets.len()).map(of).collect()
    }

    fn grown(&self, tet: usize) -> f64 {
        self.growth.get(tet).copied().unwrap_or(1.0)
    }

    /// Contact pressures at displacements [Pa]; empty where nothing rubs.
    pub fn pressures(&self, u: &[DVec3]) -> Vec<[f64; 6]> {
        let Some(plane) = self.loads.plane.filter(|p| p.friction > 0.0) else { return Vec::new() };
        let at = |f: &[usize; 6], shape: &[f64; 6]| f.iter().zip(shape).map(|(n, s)| *s * (self.mesh.nodes[*n] + u[*n])).sum();
        let face = |(f, patches): (&[usize; 6], &[([f64; 6], f64); 6])| patches.map(|p| plane.pressure(at(f, &p.0)));
        self.mesh.faces.iter().zip(&self.elements.patches).map(face).collect()
    }

    fn tetrahedron(&self, t: usize, m: &Motion, u: &[DVec3], derive: bool) -> Local {
        let nodes = &self.mesh.tets[t];
        let places = nodes.map(|n| self.mesh.nodes[n] + u[n]);
        let change = nodes.map(|n| u[n] - m.before[n]);
        let start = nodes.map(|n| m.before_velocity[n]);
        let (mut energy, mut force, mut blocks) = (0.0, [DVec3::ZERO; 10], Vec::new());
        if derive {
            blocks = vec![DMat3::ZERO; 55];
        }
        // Inertia ½ c² wᵀMw − c wᵀMv and damping ½ α c wᵀMw of the change w, and weight.
        let [inertia, damped] = [m.rate * m.rate, self.mass_damping * m.rate];
        for (i, row) in self.mass[t].iter().enumerate() {
            let sum = |field: &[DVec3; 10]| row.iter().zip(field).map(|(m, f)| *m * *f).sum::<DVec3>();
            let (moved, began) = ((inertia + damped) * sum(&change), m.rate * sum(&start));
            let weight = row.iter().sum::<f64>() * self.loads.gravity
                + self.elements.products[t][i].iter().sum::<f64>() * self.loads.force;
            force[i] += moved - began - weight;
            energy += change[i].dot(0.5 * moved - began) - weight.dot(u[nodes[i]]);
            if derive {
                (i..10).for_each(|j| blocks[place(i, j)] += DMat3::from_diagonal(DVec3::splat((inertia + damped) * row[j])));
            }
        }
        let viscous = self.stiffness_damping * m.rate;
        // Of the deformation only what growth does not explain is elastic.
        let grown = self.grown(t);
        for (k, p) in self.elements.points[t].iter().enumerate() {
            let f = p.gradient(&places) * (1.0 / grown);
            let volume = p.volume * self.stiffness[t] * grown.powi(3);
            let gradients = p.gradients.map(|g| g / grown);
            let e = green(f) - m.before_strain[t][k];
            energy += volume * self.material.energy(f);
            let mut stress = self.material.stress(f) * volume;
            if viscous > 0.0 {
                energy += viscous * volume * self.material.quadratic(e);
                stress += self.material.quadratic_stress(f, e) * (viscous * volume);
            }
            (0..10).for_each(|i| force[i] += stress * gradients[i]);
            if derive {
                let mut tangent = self.material.tangent(f);
                if viscous > 0.0 {
                    let more = self.material.quadratic_tangent(f, e);
                    tangent.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(t, m)| *t += *m * viscous);
                }
                stiffen(&mut blocks, &tangent, &gradients, volume);
            }
            let place_of = || p.shape.iter().zip(&places).map(|(s, x)| *s * *x).sum();
            if self.loads.magnet.is_some()
                && let Some((e, g, h)) = self.loads.in_volume(place_of())
            {
                energy += p.volume * e;
                for i in 0..10 {
                    force[i] += p.volume * p.shape[i] * g;
                    if derive {
                        (i..10).for_each(|j| blocks[place(i, j)] += h * (p.volume * p.shape[i] * p.shape[j]));
                    }
                }
            }
        }
        (energy, force, blocks)
    }

    /// Calls `each` with every point of the surface that feels something: its face, its shape functions and what it feels.
    fn surface(&self, m: &Motion, u: &[DVec3], mut each: impl FnMut(&[usize; 6], &[f64; 6], (f64, DVec3, DMat3))) {
        if self.loads.plane.is_none() && self.loads.drag == 0.0 {
            return;
        }
        for (k, (face, patches)) in self.mesh.faces.iter().zip(&self.elements.patches).enumerate() {
            for (q, (shape, area)) in patches.iter().enumerate() {
                let mean = |field: &dyn Fn(usize) -> DVec3| face.iter().zip(shape).map(|(n, s)| *s * field(*n)).sum::<DVec3>();
                let at = Contact {
                    area: *area,
                    place: mean(&|n| self.mesh.nodes[n] + u[n]),
                    way: mean(&|n| u[n] - m.old[n]),
                    change: mean(&|n| u[n] - m.before[n]),
                    rate: m.rate,
                    step: m.step,
                    pressure: m.pressures.get(k).map_or(0.0, |p| p[q]),
                };
                if !self.loads.idle(&at) {
                    each(face, shape, self.loads.on_surface(&at));
                }
            }
        }
    }

    /// The energy of new displacements.
    pub fn energy(&self, m: &Motion, u: &[DVec3]) -> f64 {
        let inside: Vec<f64> = (0..self.mesh.tets.len()).into_par_iter().map(|t| self.tetrahedron(t, m, u, false).0).collect();
        let mut sum = inside.iter().sum::<f64>() - self.forces.iter().zip(u).map(|(f, u)| f.dot(*u)).sum::<f64>();
        self.surface(m, u, |_, _, (e, ..)| sum += e);
        sum
    }

    /// Its value and gradient.
    pub fn gradient(&self, m: &Motion, u: &[DVec3]) -> (f64, Vec<DVec3>) {
        let local: Vec<Local> = (0..self.mesh.tets.len()).into_par_iter().map(|t| self.tetrahedron(t, m, u, false)).collect();
        let mut gradient: Vec<DVec3> = self.forces.iter().map(|f| -*f).collect();
        gradient.resize(u.len(), DVec3::ZERO);
        let mut energy = -self.forces.iter().zip(u).map(|(f, u)| f.dot(*u)).sum::<f64>();
        for ((e, force, _), nodes) in local.iter().zip(&self.mesh.tets) {
            energy += e;
            (0..10).for_each(|i| gradient[nodes[i]] += force[i]);
        }
        self.surface(m, u, |face, shape, (e, g, _)| {
            energy += e;
            (0..6).for_each(|i| gradient[face[i]] += shape[i] * g);
        });
        (energy, gradient)
    }

    /// Its value and gradient; `add` gets blocks of its second derivative, of every pair of nodes in one order only.
    pub fn derivatives(&self, m: &Motion, u: &[DVec3], mut add: impl FnMut(usize, usize, DMat3)) -> (f64, Vec<DVec3>) {
        let local: Vec<Local> = (0..self.mesh.tets.len()).into_par_iter().map(|t| self.tetrahedron(t, m, u, true)).collect();
        let mut gradient = vec![DVec3::ZERO; u.len()];
        self.forces.iter().zip(&mut gradient).for_each(|(f, g)| *g = -*f);
        let mut energy = -self.forces.iter().zip(u).map(|(f, u)| f.dot(*u)).sum::<f64>();
        for ((e, force, blocks), nodes) in local.iter().zip(&self.mesh.tets) {
            energy += e;
            for i in 0..10 {
                gradient[nodes[i]] += force[i];
                (i..10).for_each(|j| add(nodes[i], nodes[j], blocks[place(i, j)]));
            }
        }
        self.surface(m, u, |face, shape, (e, g, h)| {
            energy += e;
            for i in 0..6 {
                gradient[face[i]] += shape[i] * g;
                (i..6).for_each(|j| add(face[i], face[j], h * (shape[i] * shape[j])));
            }
        });
        (energy, gradient)
    }
}

/// Adds gradientᵀ · tangent · gradient of a point.
fn stiffen(blocks: &mut [DMat3], tangent: &Tangent, gradients: &[DVec3; 10], volume: f64) {
    for (j, g) in gradients.iter().enumerate() {
        let column: [DMat3; 3] =
            std::array::from_fn(|k| (tangent[k][0] * g.x + tangent[k][1] * g.y + tangent[k][2] * g.z) * volume);
        for (i, h) in gradients.iter().enumerate().take(j + 1) {
            blocks[place(i, j)] += column[0] * h.x + column[1] * h.y + column[2] * h.z;
        }
    }
}
