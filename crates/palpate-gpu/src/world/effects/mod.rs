//! Effects on the device. Laws of points and cells are WGSL twins (`shaders/effects/`) that passes call by number; stiffness and density that
//! vary over the body or in time do not depend on the states and are computed here, in f64, from the laws themselves; so are
//! stress-free shapes (`rests`) and what effects make of clamps (`grips`).

mod grips;
mod moving;
mod rests;

use crate::device::pipelines::shared::laws;
use crate::device::pipelines::shared::points::{AT_CELLS, AT_CONTACT, AT_NODES, AT_SURFACE};
use crate::device::pipelines::shared::rates::PLANE_NUMBERS;
use crate::device::pipelines::shared::structs::{
    FIELD_AGING, FIELD_DENSITY, FIELD_GRIPS, FIELD_MODULUS, FIELD_PATCHES, FIELD_REST, FIELD_STARTS, LAWS_AT, MATERIAL_AT, NONE,
    SCALARS_AT,
};
use crate::device::{Arena, GpuError};
use crate::layout::EffectSite;
use crate::world::mass::MassTable;
use glam::DVec3;
use palpate_model::effects::cell::{ENERGY, Part};
use palpate_model::effects::law::Asks;
use palpate_model::effects::{Law, Site};
use palpate_model::params::changes::{self, Changes};
use palpate_model::params::fields::Varied;
use palpate_model::plan::{Physics, Plan};
use palpate_model::scene::InitialShape;
use palpate_model::space::body::Body;

/// Most laws of cells of a plan.
const MOST_LAWS: usize = laws::MOST_LAWS as usize;

/// A plan's effects as the device sees them.
#[derive(Debug, Default)]
pub(crate) struct Effects {
    /// Effects on points: number in the plan, and what the kernels know.
    pub(crate) points: Vec<(usize, EffectSite)>,
    /// Effects on cells, likewise.
    cells: Vec<(usize, EffectSite)>,
    /// First row of every effect that changes the stiffness in time or acts on clamps, among those that do.
    first_rows: Vec<Option<u32>>,
    /// As `Shape` has them.
    pub(crate) bits: u32,
    /// Parameters of changes in time.
    pub(crate) aging_rows: u32,
    /// Parameters of how clamps are held: effect and number of each.
    grip_rows: Vec<[usize; 2]>,
    /// What a file moves.
    things: moving::Things,
    /// Those among them that change the clamps' matrices, by their row.
    matrix_rows: Vec<usize>,
    /// The material has a viscosity.
    viscous: bool,
    /// Stages: solves of all steps.
    steps: usize,
    stride: u32,
    rows: u32,
}

impl Effects {
    /// The effects of a plan.
    ///
    /// # Errors
    /// One of them has no place on the device.
    pub(crate) fn new(plan: &Plan) -> Result<Effects, GpuError> {
        if !plan.model.has_twin() {
            let what = format!("the material \"{}\", which the CPU backend has", plan.model.name);
            return Err(GpuError::Plan { what });
        }
        if plan.clock.scheme.still {
            return Err(GpuError::Plan { what: "a quasi-static sequence (time.mode), which the CPU backend has".into() });
        }
        let mut e = Effects { steps: plan.clock.stages().len(), viscous: plan.layout.is_viscous(), ..Effects::default() };
        for (number, (law, places)) in plan.layout.effects().enumerate() {
            let count = places.len() as u32;
            let asks = match law.asks() {
                _ if matches!(law.site, Site::Jet) && plan.initial == InitialShape::StaticEquilibrium => {
                    Some("initial.state = \"static-equilibrium\" brings to rest with the body")
                }
                Asks::Nothing => None,
                Asks::Path => Some("follows a path"),
                Asks::Series => Some("is driven by a file"),
                Asks::Normal => Some("turns with the surface"),
            };
            if let Some(asks) = asks {
                let what = format!("the effect \"{}\", which {asks} and which the CPU backend has", law.kind);
                return Err(GpuError::Plan { what });
            }
            let mut row = None;
            let site = match law.site {
                Site::Nodes(_) => Some(AT_NODES),
                Site::Surface(_) => Some(AT_SURFACE),
                Site::Contact(_) => Some(AT_CONTACT),
                Site::Modulus(_) | Site::Density(_) => {
                    e.bits |= if matches!(law.site, Site::Modulus(_)) { FIELD_MODULUS } else { FIELD_DENSITY };
                    None
                }
                Site::Aging(_) => {
                    e.bits |= FIELD_AGING;
                    row = Some(e.aging_rows);
                    e.aging_rows += count;
                    None
                }
                Site::Rest(_) if plan.initial == InitialShape::Given => {
                    let what = "the effect \"rest-shape\" beside object.state = \"static\", which the CPU backend has".into();
                    return Err(GpuError::Plan { what });
                }
                Site::Rest(_) => {
                    e.bits |= FIELD_REST | if plan.initial == InitialShape::Rest { FIELD_STARTS } else { 0 };
                    None
                }
                Site::Clamps(_) | Site::Edges(_) => {
                    e.bits |= FIELD_GRIPS;
                    row = Some(e.grip_rows.len() as u32);
                    e.grip_rows.extend((0..places.len()).map(|slot| [number, slot]));
                    None
                }
                Site::Cells(_) if e.cells.len() == MOST_LAWS => {
                    return Err(GpuError::Plan { what: format!("more than {MOST_LAWS} laws of cells") });
                }
                Site::Cells(_) => Some(AT_CELLS),
                Site::Obstacle | Site::Jet => {
                    e.bits |= FIELD_PATCHES;
                    e.things.add(plan, number, &law.site, e.stride);
                    None
                }
                // The observer's business.
                Site::Clock | Site::Marker | Site::Readings(_) | Site::Driven(_) => None,
            };
            e.first_rows.push(row);
            if let Some(site) = site.filter(|s| *s == AT_CELLS) {
                let law = palpate_model::effects::find(law.kind).unwrap_or_default() as u32;
                e.cells.push((number, EffectSite { law, site, first: e.stride, count, ..EffectSite::default() }));
            } else if let Some(site) = site {
                e.bits |= if site == AT_NODES { 0 } else { FIELD_PATCHES };
                let slopes = if shares(plan, law, &plan.theta[places]).is_some() { e.rows + 1 } else { NONE };
                let law = palpate_model::effects::find(law.kind).unwrap_or_default() as u32;
                let point = EffectSite { law, site, first: e.stride, count, measures: e.rows, slopes, stride: 0, rows: 0 };
                e.points.push((number, point));
                if site == AT_NODES {
                    e.rows += if slopes == NONE { 1 } else { 1 + count };
                }
            }
            e.stride += count;
        }
        if plan.initial == InitialShape::Given {
            e.bits |= FIELD_REST;
        }
        for field in &plan.fields {
            e.bits |= match field.varied {
                Varied::Modulus => FIELD_MODULUS,
                Varied::Density => FIELD_DENSITY,
                Varied::Damping => return Err(GpuError::Plan { what: "fields of stiffness damping".into() }),
            };
        }
        e.matrix_rows = grips::matrix_rows(plan, &e.grip_rows);
        for (_, p) in e.points.iter_mut().chain(&mut e.cells) {
            (p.stride, p.rows) = (e.stride, e.rows);
        }
        e.bits |= scalars(plan) << SCALARS_AT | (e.cells.len() as u32) << LAWS_AT | material(plan) << MATERIAL_AT;
        Ok(e)
    }

    /// What the kernels know of the effects on points.
    pub(crate) fn sites(&self) -> Vec<EffectSite> {
        self.points.iter().map(|p| p.1).collect()
    }

    /// What the kernels know of the effects on cells.
    pub(crate) fn cell_sites(&self) -> Vec<EffectSite> {
        self.cells.iter().map(|c| c.1).collect()
    }

    /// Place of an effect among those on cells.
    pub(crate) fn cell_law(&self, effect: usize) -> Option<u32> {
        self.cells.iter().position(|c| c.0 == effect).map(|k| k as u32)
    }

    /// Place of the effects' numbers among a member's rates, and how many of these there are.
    pub(crate) fn rate_places(&self, plan: &Plan) -> [u32; 2] {
        let held: u32 = self.hold_numbers().iter().sum();
        let first = PLANE_NUMBERS * plan.planes.len() as u32 + plan.masses.len() as u32 + self.aging_rows + held;
        [first, first + self.stride]
    }

    /// Number of effects on cells.
    pub(crate) fn cell_laws(&self) -> u32 {
        self.cells.len() as u32
    }

    /// True when some effect acts on cells, or the material or its viscosity as one does.
    pub(crate) fn on_cells(&self) -> bool {
        !self.cells.is_empty() || self.bits >> MATERIAL_AT != 0 || self.viscous
    }

    /// True when some effect acts on patches.
    pub(crate) fn on_patches(&self) -> bool {
        self.bits & FIELD_PATCHES != 0
    }

    /// True when some effect acts on contact.
    pub(crate) fn on_contact(&self) -> bool {
        self.points.iter().any(|p| p.1.site == AT_CONTACT)
    }

    /// True when some effect acts on nodes.
    pub(crate) fn on_nodes(&self) -> bool {
        self.points.iter().any(|p| p.1.site == AT_NODES)
    }

    /// Row of number `slot` of an effect that changes the stiffness in time or acts on clamps.
    pub(crate) fn slope_row(&self, effect: usize, slot: u32) -> Option<u32> {
        self.first_rows[effect].map(|first| first + slot)
    }

    /// Numbers of every buffer of a batch of `members`, for a body and so many entries of a mass matrix.
    pub(crate) fn sizes(&self, members: usize, body: &Body, masses: usize, clamps: usize) -> Vec<(&'static str, usize)> {
        let [nodes, cells] = [body.nodes.len(), body.elements()];
        let of = |bit: u32, n: usize| if self.bits & bit == 0 { 0 } else { members * n };
        let mut all = vec![
            ("effect_values", members * self.stride as usize),
            ("effect_measures", members * self.rows as usize * nodes),
            ("moduli", of(FIELD_MODULUS, cells)),
            ("densities", if masses == 0 { of(FIELD_DENSITY, nodes) } else { members * masses }),
            ("agings", of(FIELD_AGING, (1 + self.aging_rows as usize) * (self.steps + 1))),
        ];
        all.extend(self.rest_sizes(members, body));
        all.push(("hold_slopes", grips::FLOATS * self.grip_rows.len() * members * (self.steps + 1) * clamps));
        all.push(("layers", of(FIELD_GRIPS, 1 + self.matrix_rows.len())));
        all.push(("moving_poses", self.moving_size(members)));
        all
    }

    /// Adds what members' parameters make of them to an arena; `found` are the stress-free shapes that follow from other numbers.
    pub(crate) fn put(&self, plan: &Plan, mass: &MassTable, batch: &[Physics], found: &[Vec<DVec3>], tables: &mut Arena) {
        let body = &plan.body;
        let sizes = self.sizes(batch.len(), body, mass.entries(), plan.clamps.len());
        let mut data: Vec<Vec<f32>> = sizes.iter().map(|s| Vec::with_capacity(s.1)).collect();
        let put = |out: &mut Vec<f32>, v: &[f64]| out.extend(v.iter().map(|x| *x as f32));
        for physics in batch {
            physics.effects.iter().for_each(|p| put(&mut data[0], p));
            for (number, site) in self.points.iter().filter(|p| p.1.site == AT_NODES) {
                let law = plan.layout.effects().nth(*number).map(|e| e.0);
                let shared = law.and_then(|law| shares(plan, law, &physics.effects[*number]));
                match shared.filter(|_| site.slopes != NONE) {
                    Some((values, slopes)) => {
                        put(&mut data[1], &values);
                        slopes.iter().for_each(|s| put(&mut data[1], s));
                    }
                    None => put(&mut data[1], &body.node_volume),
                }
            }
            let changes = Changes::new(plan, physics);
            changes.modulus.iter().for_each(|m| put(&mut data[2], m));
            match (mass.entries(), changes.density.as_deref()) {
                (0, density) => density.iter().for_each(|d| put(&mut data[3], d)),
                (_, density) => put(&mut data[3], &mass.matrix(plan, density)),
            }
        }
        if self.bits & FIELD_AGING != 0 {
            data[4] = self.agings(plan, batch);
        }
        if self.bits & FIELD_REST != 0 {
            self.rests(plan, batch, found).into_iter().enumerate().for_each(|(k, v)| data[5 + k] = v);
        }
        data[7] = self.hold_slopes(plan, batch);
        data[8] = self.layers(plan, batch);
        data[9] = self.moving_poses(plan, batch);
        for ((name, size), values) in sizes.iter().zip(&data) {
            debug_assert_eq!(*size, values.len(), "{name}");
            tables.put(name, values);
        }
    }

    /// Factor on the stiffness and its derivatives, `[1 + rows][B][steps + 1]`, at the start and at the instant that each step's forces
    /// are taken at.
    fn agings(&self, plan: &Plan, batch: &[Physics]) -> Vec<f32> {
        let stages = plan.clock.stages();
        let times: Vec<f64> = std::iter::once(0.0).chain(stages.iter().map(|s| s.time - (1.0 - s.theta) * s.length)).collect();
        let mut out = Vec::new();
        for physics in batch {
            out.extend(times.iter().map(|t| changes::aging(plan, physics, *t) as f32));
        }
        let aging = |law: &Law| matches!(law.site, Site::Aging(_));
        for (effect, (_, places)) in plan.layout.effects().enumerate().filter(|(_, e)| aging(e.0)) {
            for slot in 0..places.len() {
                for physics in batch {
                    let slope = |t: &f64| changes::aging_slope(plan, physics, *t, effect, slot).unwrap_or(0.0) as f32;
                    out.extend(times.iter().map(slope));
                }
            }
        }
        out
    }
}

/// Number of a plan's material in the table of materials, 0 where it is the one that cells are made of.
fn material(plan: &Plan) -> u32 {
    let number = palpate_model::materials::ALL.iter().position(|m| m == plan.model).unwrap_or_default();
    if plan.model.is_linear { 0 } else { number as u32 }
}

/// Number of scalars that the energies of a plan's laws of cells and its material depend on; 0 without any.
fn scalars(plan: &Plan) -> u32 {
    if material(plan) != 0 {
        return ENERGY as u32;
    }
    let needs = |law: &Law| if let Site::Cells(cell) = law.site { cell.needs(Part::Energy) } else { 0 };
    let viscous = usize::from(plan.layout.is_viscous());
    plan.layout.effects().map(|(law, _)| needs(law)).fold(viscous, usize::max) as u32
}

/// Shares of the nodes in a load that they carry together, with derivatives.
fn shares(plan: &Plan, law: &Law, p: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let Site::Nodes(point) = law.site else { return None };
    point.shares(&plan.body.nodes, &plan.body.node_volume, p)
}
