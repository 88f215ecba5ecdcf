//! How the coefficients of the balance change along directions of tangents: what kernels read of it, uploaded once for a whole evaluation.

use super::World;
use super::geometry::Geometry;
use crate::device::pipelines::shared::rates::{WITH_DENSITIES, WITH_MODULI, WITH_POISSON, WITH_RESTS};
use crate::device::recorder::Buffers;
use crate::device::{Arena, Maker as _, whole};
use crate::layout::Rate;
use glam::DVec3;
use palpate_engine::{Direction, StressFreeShapes};
use palpate_model::effects::Site;
use palpate_model::params::ParamKey;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::{Physics, Plan};

/// The buffer of a direction's tables.
const RATES: &str = "rates_tables";
/// On a body of elastic points, the change of the stress-free shape as a vector a node, which passes take for the vector `probe`.
pub(crate) const REST_CHANGE: &str = "rest_change";

/// One direction, for all members.
#[derive(Debug)]
pub(crate) struct Rates {
    /// The direction.
    pub(crate) direction: Direction,
    /// By the names that kernels know them by.
    pub(crate) buffers: Buffers,
    /// What kernels are told: bits of `shared/rates.wgsl`.
    pub(crate) flags: u32,
    /// Coefficients that change.
    pub(crate) moved: Sought,
    /// The velocity at the start changes.
    pub(crate) flying: bool,
}

fn vec4(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

/// Numbers of a member in the order of `shared/rates.wgsl`.
fn numbers(geometry: &Geometry, plan: &Plan, p: &Physics, out: &mut Vec<f32>) {
    let effects = &geometry.effects;
    let own = |pick: fn(&Site) -> bool| {
        let numbered = plan.layout.effects().zip(&p.effects).enumerate();
        numbered.filter(move |(_, ((law, _), _))| pick(&law.site)).flat_map(|(_, (_, values))| values.iter().map(|v| *v as f32))
    };
    p.planes.iter().for_each(|[height, theta, phi]| out.extend([*height as f32, *theta as f32, *phi as f32, 0.0]));
    out.extend(p.masses.iter().map(|m| *m as f32));
    out.extend(own(|s| matches!(s, Site::Aging(_))));
    let poses: Vec<f32> = own(|s| matches!(s, Site::Clamps(_) | Site::Edges(_))).collect();
    out.extend(&poses);
    out.extend(effects.matrix_rows().iter().map(|row| poses[*row]));
    out.extend(p.effects.iter().flatten().map(|v| *v as f32));
}

/// Bytes of what a direction along one parameter changes, for `members`.
pub(crate) fn bytes(geometry: &Geometry, plan: &Plan, place: usize, members: u64) -> u64 {
    let shape = &geometry.shape;
    let varies = |on: fn(&Site) -> bool, field: bool| match plan.layout.keys[place] {
        ParamKey::Effect { law, .. } => on(&palpate_model::effects::ALL[usize::from(law)].site),
        ParamKey::Field { .. } => field,
        _ => false,
    };
    let sought = Sought::new(plan, &(0..plan.layout.len()).map(|p| p == place).collect::<Vec<_>>());
    let densities = if geometry.mass.entries() == 0 { shape.nodes } else { shape.blocks };
    let of = |moves: bool, bytes: u32| if moves { u64::from(bytes) * members } else { 0 };
    let tables = [
        size_of::<Rate>() as u64 * members,
        4 * u64::from(shape.rate_numbers) * members,
        of(varies(|s| matches!(s, Site::Modulus(_)), sought.modulus), 4 * shape.elements),
        of(varies(|s| matches!(s, Site::Density(_)), sought.density), 4 * densities),
        of(sought.rest, 16 * shape.nodes),
    ];
    let probed = if shape.elastic != 0 && sought.rest { whole(tables[4]) } else { 0 };
    whole(Arena::bytes(RATES, tables.iter().sum())) + probed
}

/// What one direction makes of all members so far.
#[derive(Default)]
struct Gathered {
    rates: Vec<Rate>,
    numbers: Vec<f32>,
    moduli: Vec<f32>,
    densities: Vec<f32>,
    rests: Vec<[f32; 4]>,
}

impl Gathered {
    fn add(&mut self, world: &World, rate: &Coefficients) {
        let p = &rate.physics;
        self.rates.push(Rate {
            young: p.youngs_modulus as f32,
            poisson: p.poisson_ratio as f32,
            density: p.density as f32,
            mass_damping: p.mass_damping as f32,
            stiffness_damping: p.stiffness_damping as f32,
            start: p.start as f32,
            viscosity: p.viscosity.map_or([0.0; 2], |v| [v.coefficient as f32, v.exponent as f32]),
            gravity: vec4(p.gravity),
            velocity: vec4(p.velocity),
            spin: vec4(p.angular_velocity),
        });
        numbers(&world.geometry, &world.plan, p, &mut self.numbers);
        // Which arrays there are depends on the direction alone, not on the member: see `fill`.
        self.moduli.extend(rate.changes.modulus.iter().flatten().map(|v| *v as f32));
        let (mass, density) = (&world.geometry.mass, rate.changes.density.as_deref());
        match (mass.entries(), density) {
            (0, _) | (_, None) => self.densities.extend(density.unwrap_or_default().iter().map(|v| *v as f32)),
            (_, factors) => self.densities.extend(mass.matrix(&world.plan, factors).iter().map(|v| *v as f32)),
        }
        self.rests.extend(rate.changes.rest.iter().flatten().map(|v| vec4(*v)));
    }

    fn upload(self, world: &World, direction: &Direction) -> Rates {
        let bit = |empty: bool, bit: u32| if empty { 0 } else { bit };
        let mut moved = vec![false; world.plan.layout.len()];
        direction.entries().for_each(|(p, _)| moved[p] = true);
        let moved = Sought::new(&world.plan, &moved);
        let flying = self.rates.iter().any(|r| r.velocity != [0.0; 4] || r.spin != [0.0; 4]);
        let flags = bit(self.moduli.is_empty(), WITH_MODULI)
            | bit(self.densities.is_empty(), WITH_DENSITIES)
            | bit(self.rests.is_empty(), WITH_RESTS)
            | bit(!moved.poisson, WITH_POISSON);
        let mut buffers = Buffers::new();
        let mut tables = Arena::new(RATES);
        tables.put("rates", &self.rates);
        tables.put("rate_numbers", &self.numbers);
        tables.put("rate_moduli", &self.moduli);
        tables.put("rate_densities", &self.densities);
        tables.put("rate_rests", &self.rests);
        let mut made = tables.upload(&*world.gpu, &mut buffers);
        if world.geometry.shape.elastic != 0 && !self.rests.is_empty() {
            made = made.and_then(|()| {
                buffers.insert(REST_CHANGE, world.gpu.upload(REST_CHANGE, &self.rests)?);
                Ok(())
            });
        }
        if let Err(e) = made {
            world.gpu.keep(e);
            // Something to bind; the error is read before any number.
            buffers.extend([RATES, REST_CHANGE].map(|name| (name, world.gpu.small())));
        }
        Rates { direction: direction.clone(), buffers, flags, moved, flying }
    }
}

/// A member's coefficients along directions, with the change of its stress-free shape. Where that fails the member has failed.
fn shaped(
    world: &World,
    shapes: &dyn StressFreeShapes,
    member: usize,
    rates: impl Iterator<Item = Coefficients>,
) -> Vec<Coefficients> {
    let mut rates: Vec<Coefficients> = rates.collect();
    if world.batch.refusal(member).is_none()
        && let Err(failure) = shapes.along(member, &mut rates)
    {
        world.batch.refused.borrow_mut()[member] = Some(failure);
    }
    rates
}

/// Where an array changes along the direction of some members, it does in all of them: by nothing where their own directions leave it.
fn fill<T: Clone + Default>(rates: &mut [Coefficients], array: impl Fn(&mut Coefficients) -> &mut Option<Vec<T>>) {
    let Some(len) = rates.iter_mut().find_map(|r| array(r).as_ref().map(Vec::len)) else { return };
    for r in rates {
        array(r).get_or_insert_with(|| vec![T::default(); len]);
    }
}

impl Rates {
    /// Along every direction.
    pub(crate) fn all(world: &World, directions: &[Direction]) -> Vec<Rates> {
        let (plan, theta) = (&world.plan, &world.batch.theta);
        let members: Vec<Coefficients> = theta.iter().map(|row| Coefficients::new(plan, row)).collect();
        let along = |b: usize, direction: &Direction| members[b].along(plan, &direction.of(b).dense(plan.layout.len()));
        // Where the stress-free shape follows from the other numbers, all directions of a member at once.
        let of = |shapes: &dyn StressFreeShapes, b| shaped(world, shapes, b, directions.iter().map(|d| along(b, d))).into_iter();
        let mut shaped: Vec<std::vec::IntoIter<Coefficients>> =
            world.shapes.iter().flat_map(|shapes| (0..members.len()).map(|b| of(shapes.as_ref(), b))).collect();
        let mut one = |direction: &Direction| {
            let own = |b: usize| shaped.get_mut(b).and_then(Iterator::next).unwrap_or_else(|| along(b, direction));
            let mut rates: Vec<Coefficients> = (0..members.len()).map(own).collect();
            fill(&mut rates, |r| &mut r.changes.modulus);
            fill(&mut rates, |r| &mut r.changes.density);
            fill(&mut rates, |r| &mut r.changes.rest);
            let mut all = Gathered::default();
            rates.iter().for_each(|r| all.add(world, r));
            all.upload(world, direction)
        };
        directions.iter().map(&mut one).collect()
    }

    /// All buffers, for passes.
    pub(crate) fn named(&self) -> Vec<(&'static str, &wgpu::Buffer)> {
        self.buffers.iter().map(|(name, buffer)| (*name, buffer)).collect()
    }
}
