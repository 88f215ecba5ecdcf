//! What an adjoint sums up on the device: derivatives of the cost by the coefficients of the balance, and what the host makes of them.

use super::World;
use super::effects::Effects;
use super::geometry::Geometry;
use crate::device::pipelines::shared::points::{AT_CONTACT, AT_NODES};
use crate::device::pipelines::shared::pulls::{CELL_ROWS, CELL_SLOTS, HELD_ROWS, HOLD_ROWS, PLANE_ROWS, POINT_ROWS};
use crate::layout::Shape;
use glam::DVec3;
use palpate_engine::{Failure, Wanted};
use palpate_model::effects::Site;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::Plan;
use palpate_model::space::tets::lumped;
use std::collections::HashMap;

/// Derivatives that are wanted, and where their sums lie.
#[derive(Debug)]
pub(crate) struct Sums {
    /// Coefficients that they are taken by.
    pub(crate) sought: Sought,
    /// First row of sums of every effect on points, in the device's order.
    pub(crate) points: Vec<u32>,
    /// Parameters that are wanted `[P]`.
    wanted: Vec<bool>,
    /// Rows of sums of all effects on points.
    point_rows: u32,
}

/// What was read of all members, by the names of the buffers.
pub(crate) type Found = HashMap<&'static str, Vec<f32>>;

impl Sums {
    /// Those of a plan whose effects the device knows; `None` where no gradient is wanted.
    pub(crate) fn new(plan: &Plan, effects: &Effects, wanted: &Wanted) -> Option<Sums> {
        let mask = wanted.mask(plan.layout.len());
        let mut point_rows = 0;
        let rows = effects.points.iter().map(|(_, site)| {
            let planes = if site.site == AT_NODES { 0 } else { plan.planes.len().max(1) as u32 };
            let first = point_rows;
            point_rows += site.count + POINT_ROWS + PLANE_ROWS * planes;
            first
        });
        let points = rows.collect();
        wanted.any().then(|| Sums { sought: Sought::new(plan, &mask), points, wanted: mask, point_rows })
    }

    /// Buffers of a batch of `members` and their bytes.
    pub(crate) fn sizes(&self, shape: &Shape, effects: &Effects, members: u64) -> Vec<(&'static str, u64)> {
        let each = |items: u32, width: u32| u64::from(items.div_ceil(width));
        let [nodes, cells, holds] = [shape.nodes, shape.cells, shape.holds].map(u64::from);
        let cell_rows = u64::from(CELL_ROWS + shape.aging_rows + CELL_SLOTS * effects.cell_laws());
        let own_rows = u64::from(shape.aging_rows) + effects.hold_numbers().iter().map(|n| u64::from(*n)).sum::<u64>();
        let hold_rows = u64::from(HOLD_ROWS) + own_rows;
        let floats = [
            // By the modulus of every cell, then the rows of sums.
            ("cell_sums", cells + cell_rows * each(shape.cells, 8)),
            ("elastic_pulls", shape.elastic.into()),
            ("elastic_sums", u64::from(CELL_ROWS + shape.aging_rows) * u64::from(shape.elastic)),
            ("density_pulls", shape.elastic.into()),
            (
                "law_sums",
                u64::from(CELL_SLOTS * effects.cell_laws()) * if shape.elastic == 0 { 0 } else { shape.elements.into() },
            ),
            ("held_sums", if shape.held == 0 { 0 } else { (u64::from(HELD_ROWS) + own_rows) * each(shape.nodes, 64) }),
            ("hold_pulls", holds),
            ("hold_sums", hold_rows * each(shape.holds, 8)),
            ("node_pulls", nodes),
            ("node_sums", 8 * each(shape.nodes, 64)),
            ("rest_pulls", if self.sought.rest { 4 * nodes } else { 0 }),
            ("mass_pulls", u64::from(shape.masses)),
            ("patch_sums", 4 * u64::from(shape.planes) * each(shape.patches, 64)),
            ("point_sums", u64::from(self.point_rows) * u64::from(shape.point_items)),
            ("moving_sums", u64::from(shape.moving_rows) * u64::from(shape.patches)),
            ("velocity_sums", 8 * each(shape.nodes, 64)),
        ];
        floats.into_iter().map(|(name, count)| (name, 4 * count * members)).collect()
    }

    /// dJ/dθ `[P]` of one member.
    ///
    /// # Errors
    /// A linear solve for the stress-free shape fails.
    pub(crate) fn gradient(&self, world: &World, member: usize, found: &Found) -> Result<Vec<f64>, Failure> {
        let (plan, geometry, theta) = (&world.plan, &world.geometry, &world.batch.theta[member]);
        let own = Coefficients::new(plan, theta);
        let at = Member { shape: &geometry.shape, member, found };
        let mut g = Coefficients::zero_gradient(plan, &self.sought);
        at.add_material(plan, &own, geometry, &mut g);
        at.add_numbers(&mut g);
        self.add_effects(plan, &geometry.effects, &at, &mut g);
        if let Some(shapes) = &world.shapes {
            shapes.pull(member, &self.sought, &mut g)?;
        }
        let mut out = vec![0.0; plan.layout.len()];
        own.pull_back(plan, &g, &self.wanted, &mut out);
        Ok(out)
    }

    /// The numbers of effects, and what laws of points depend on beside them.
    fn add_effects(&self, plan: &Plan, effects: &Effects, at: &Member, g: &mut Coefficients) {
        let shape = at.shape;
        let [poses, _] = effects.hold_numbers();
        let grips = |row: u32| at.holds(HOLD_ROWS + shape.aging_rows + row) + at.held(HELD_ROWS + shape.aging_rows + row);
        for (number, (law, _)) in plan.layout.effects().enumerate() {
            for (slot, out) in g.physics.effects[number].iter_mut().enumerate() {
                let row = effects.slope_row(number, slot as u32);
                *out += match (&law.site, row, effects.cell_law(number)) {
                    (Site::Aging(_), Some(row), _) => {
                        at.cells(CELL_ROWS + row)
                            + at.elastic(CELL_ROWS + row)
                            + at.holds(HOLD_ROWS + row)
                            + at.held(HELD_ROWS + row)
                    }
                    (Site::Clamps(_) | Site::Edges(_), Some(row), _) => {
                        grips(row) + effects.matrix_row(row).map_or(0.0, |k| grips(poses + k))
                    }
                    (_, _, Some(law)) => {
                        let own = CELL_SLOTS * law + slot as u32;
                        at.cells(CELL_ROWS + shape.aging_rows + own) + at.sum("law_sums", own, shape.elements, 1)[0]
                    }
                    _ => 0.0,
                };
            }
        }
        for (number, first) in effects.moving_rows(plan) {
            let row = |k: usize| at.sum("moving_sums", first + k as u32, shape.patches, 1)[0];
            let numbers = &mut g.physics.effects[number];
            numbers.iter_mut().enumerate().for_each(|(slot, out)| *out += row(slot));
            g.physics.start += row(numbers.len());
        }
        for ((number, site), first) in effects.points.iter().zip(&self.points) {
            let row = |k: u32| at.sum("point_sums", first + k, shape.point_items, 1)[0];
            g.physics.effects[*number].iter_mut().enumerate().for_each(|(slot, out)| *out += row(slot as u32));
            g.physics.gravity += DVec3::from_array([0, 1, 2].map(|a| row(site.count + a)));
            g.physics.youngs_modulus += row(site.count + 3);
            g.physics.start += row(site.count + 4);
            if site.site == AT_CONTACT {
                for (k, plane) in g.physics.planes.iter_mut().enumerate() {
                    let rows = site.count + POINT_ROWS + PLANE_ROWS * k as u32;
                    plane.iter_mut().enumerate().for_each(|(i, out)| *out += row(rows + i as u32));
                }
            }
        }
    }
}

/// The sums of one member.
struct Member<'a> {
    shape: &'a Shape,
    member: usize,
    found: &'a Found,
}

impl Member<'_> {
    /// Sum of a row over its workgroups, of vectors of `width` numbers (the others are zero); zero where nothing was summed.
    fn sum(&self, name: &'static str, row: u32, groups: u32, width: usize) -> [f64; 4] {
        let mut out = [0.0; 4];
        let (groups, members) = (groups as usize, self.shape.members as usize);
        let before = if name == "cell_sums" { members * self.shape.cells as usize } else { 0 };
        let first = before + (row as usize * members + self.member) * groups * width;
        let all = self.found.get(name).and_then(|v| v.get(first..first + groups * width)).unwrap_or(&[]);
        for vector in all.chunks_exact(width) {
            vector.iter().zip(&mut out).for_each(|(v, o)| *o += f64::from(*v));
        }
        out
    }

    fn cells(&self, row: u32) -> f64 {
        self.sum("cell_sums", row, self.shape.cells.div_ceil(8), 1)[0]
    }

    fn elastic(&self, row: u32) -> f64 {
        self.sum("elastic_sums", row, self.shape.elastic, 1)[0]
    }

    fn held(&self, row: u32) -> f64 {
        self.sum("held_sums", row, self.shape.nodes.div_ceil(64), 1)[0]
    }

    fn holds(&self, row: u32) -> f64 {
        self.sum("hold_sums", row, self.shape.holds.div_ceil(8), 1)[0]
    }

    /// Numbers that every item has one of `width`, as double precision.
    fn items(&self, name: &'static str, items: u32, width: usize) -> Vec<f64> {
        let count = items as usize * width;
        let own = self.found.get(name).and_then(|v| v.get(self.member * count..(self.member + 1) * count));
        own.map_or_else(|| vec![0.0; count], |v| v.iter().map(|v| f64::from(*v)).collect())
    }

    /// What lies on cells and nodes, and the numbers of the material that it makes.
    fn add_material(&self, plan: &Plan, own: &Coefficients, geometry: &Geometry, g: &mut Coefficients) {
        let shape = self.shape;
        let mut modulus = self.items("cell_sums", shape.cells, 1);
        let points = self.items("elastic_pulls", shape.elastic, 1);
        modulus.extend(points.chunks(shape.per_element as usize).map(|p| p.iter().sum::<f64>()));
        let holds = self.items("hold_pulls", shape.holds, 1);
        geometry.holds.iter().zip(&holds).for_each(|((_, cell), h)| modulus[*cell as usize] += h);
        let density = self.items("node_pulls", shape.nodes, 1);
        let whole = |by: &[f64], factors: &Option<Vec<f64>>| match factors {
            Some(f) => by.iter().zip(f).map(|(b, f)| b * f).sum::<f64>(),
            None => by.iter().sum(),
        };
        g.physics.youngs_modulus += (whole(&modulus, &own.changes.modulus) + self.held(1)) / own.physics.youngs_modulus;
        // Of tetrahedra the factors are in the matrix already.
        let factors = if geometry.mass.entries() == 0 { &own.changes.density } else { &None };
        g.physics.density += whole(&density, factors);
        if let Some(out) = &mut g.changes.modulus {
            *out = modulus;
        }
        if let Some(out) = &mut g.changes.density {
            *out = density.iter().map(|d| own.physics.density * d).collect();
            if geometry.mass.entries() != 0 {
                *out = self.densities_of_nodes(plan, own.physics.density);
            }
        }
        if let Some(out) = &mut g.changes.rest {
            let rest = self.items("rest_pulls", shape.nodes, 4);
            *out = rest.chunks_exact(4).map(DVec3::from_slice).collect();
        }
    }

    /// Derivatives by the factors on the densities of nodes, each of which has its share of its elements'.
    fn densities_of_nodes(&self, plan: &Plan, density: f64) -> Vec<f64> {
        let (points, mut out) = (&plan.body.points, vec![0.0; plan.body.nodes.len()]);
        let pulls = self.items("density_pulls", self.shape.elastic, 1);
        for e in 0..points.elements() {
            let s = points.bearers(e);
            let by = density * pulls[points.mean_point(e)];
            s.nodes.iter().zip(lumped(s.nodes.len())).for_each(|(n, w)| out[*n as usize] += w * by);
        }
        out
    }

    /// The numbers of the scene that act through sums.
    fn add_numbers(&self, g: &mut Coefficients) {
        let (shape, p) = (self.shape, &mut g.physics);
        let nodes = |name, row| self.sum(name, row, shape.nodes.div_ceil(64), 4);
        let by = nodes("node_sums", 0);
        p.youngs_modulus += by[0];
        p.poisson_ratio += self.cells(0) + self.elastic(0) + self.holds(0) + self.held(2) + by[1];
        p.stiffness_damping += self.cells(1) + self.elastic(1) + by[2];
        p.mass_damping += by[3];
        if let Some(v) = &mut p.viscosity {
            v.coefficient += self.cells(2) + self.elastic(2);
            v.exponent += self.cells(3) + self.elastic(3);
        }
        p.start += self.holds(1) + self.held(0);
        p.gravity += DVec3::from_slice(&nodes("node_sums", 1));
        p.velocity += DVec3::from_slice(&nodes("velocity_sums", 0));
        p.angular_velocity += DVec3::from_slice(&nodes("velocity_sums", 1));
        for (k, plane) in p.planes.iter_mut().enumerate() {
            let by = self.sum("patch_sums", k as u32, shape.patches.div_ceil(64), 4);
            p.youngs_modulus += by[0];
            plane.iter_mut().zip(&by[1..]).for_each(|(out, b)| *out += b);
        }
        let masses = self.items("mass_pulls", shape.masses, 1);
        p.masses.iter_mut().zip(masses).for_each(|(out, m)| *out += m);
    }
}
