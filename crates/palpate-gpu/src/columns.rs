//! ∂r/∂p on the device: which passes make the column of each parameter, for the adjoint (dotted with z) and for tangents.

use crate::effects;
use crate::pipelines::pass;
use crate::solve::{ALL, NO_TOUCH, Per, Solve};
use palpate_model::effects::Site;
use palpate_model::params::ParamKey;

/// How a parameter enters the balance: numbers of `shared/keys.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Column {
    kind: u32,
    index: u32,
    /// What the passes of cells, patches and clamps are told; `None` = the parameter acts on nodes alone.
    cells: Option<[u32; 2]>,
    /// The question to effects on points, and the effect that is asked where it is a single one.
    press: Option<(u32, Option<usize>)>,
}

/// Clamps that have no part in a column.
const NO_HOLD: u32 = 6;
/// A kind that no kernel knows: the column is zero.
const NOTHING: u32 = 15;
/// What cells and their laws depend on.
const YOUNGS_MODULUS: u32 = 0;
const POISSON_RATIO: u32 = 1;
/// Kinds of parameters of effects.
const EFFECT: u32 = 11;
const MODULUS_SLOPE: u32 = 12;
const DENSITY_SLOPE: u32 = 13;
const AGING_SLOPE: u32 = 14;
const REST_SLOPE: u32 = 16;
const START_SHAPE: u32 = 17;
const START_SPIN: u32 = 18;
/// Kinds in an argument, beside the index.
const KINDS: u32 = 32;
/// What the clamps' pass is told for stiffness that varies over the body, in time, plus 256 times the row of its slopes.
const HOLD_SLOPE: u32 = 7;
const HOLD_AGING: u32 = 8;
/// For the stress-free shape, and for how effects hold the clamps.
const HOLD_REST: u32 = 9;
const HOLD_GRIP: u32 = 10;
/// Added to a node pass' argument: cells take part; added to the sum's argument: ∂v/∂p of the start.
const FLAG: u32 = 1 << 16;
/// Added to the sum's argument: ∂u/∂p of the start.
const OF_SHAPE: u32 = 1 << 17;

impl Solve<'_, '_> {
    /// How a parameter enters this balance, or `None`.
    pub(crate) fn column_of(&self, key: ParamKey) -> Option<Column> {
        let dynamic = self.step.is_some();
        let column = |kind, index: u32, cells| Some(Column { kind, index, cells, press: None });
        let plane = |what: u32, i: u16| {
            let index = 8 * u32::from(i) + what;
            Some(Column { kind: 9, index: 0, cells: Some([index, NO_HOLD]), press: Some((effects::column(9, index), None)) })
        };
        // Effects on points answer to these as well.
        let pressed = |kind, index, cells| Some(Column { kind, index, cells, press: Some((effects::column(kind, index), None)) });
        match key {
            ParamKey::YoungsModulus => pressed(YOUNGS_MODULUS, 0, Some([1, 2])),
            ParamKey::PoissonRatio => column(POISSON_RATIO, 0, Some([NO_TOUCH, 3])),
            ParamKey::Density => column(2, 0, None),
            ParamKey::MassDamping if dynamic => column(3, 0, None),
            ParamKey::StiffnessDamping if dynamic => column(4, 0, Some([NO_TOUCH, NO_HOLD])),
            ParamKey::Gravity(a) => pressed(5, a.into(), None),
            ParamKey::TimeStart if self.world.plan.clamps.iter().any(|c| c.motion.is_some()) => {
                pressed(8, 0, Some([NO_TOUCH, 4]))
            }
            ParamKey::TimeStart if !self.world.geometry.effects.points.is_empty() => pressed(8, 0, None),
            ParamKey::PlaneHeight(i) => plane(2, i),
            ParamKey::PlaneTheta(i) => plane(3, i),
            ParamKey::PlanePhi(i) => plane(4, i),
            ParamKey::PointMass(i) => column(10, i.into(), None),
            ParamKey::Effect { effect, slot, law } => self.column_of_effect(effect.into(), slot.into(), law.into()),
            _ => None,
        }
    }

    fn column_of_effect(&self, effect: usize, slot: u32, law: usize) -> Option<Column> {
        let known = &self.world.geometry.effects;
        if let Some(row) = known.slope_row(effect, slot) {
            return Some(match palpate_model::effects::ALL[law].site {
                Site::Modulus(_) => {
                    let cells = Some([NO_TOUCH, HOLD_SLOPE + 256 * row]);
                    Column { kind: MODULUS_SLOPE, index: row, cells, press: None }
                }
                Site::Aging(_) => {
                    let cells = Some([NO_TOUCH, HOLD_AGING + 256 * row]);
                    Column { kind: AGING_SLOPE, index: row, cells, press: None }
                }
                Site::Rest(_) => {
                    let cells = Some([NO_TOUCH, HOLD_REST + 256 * row]);
                    Column { kind: REST_SLOPE, index: row, cells, press: None }
                }
                Site::Clamps(_) | Site::Edges(_) => {
                    let matrix = known.matrix_row(row).map_or(0, |k| (k + 1) << 16);
                    let cells = Some([NO_TOUCH, HOLD_GRIP + 256 * row + matrix]);
                    Column { kind: NOTHING, index: 0, cells, press: None }
                }
                _ => Column { kind: DENSITY_SLOPE, index: row, cells: None, press: None },
            });
        }
        if let Some(law) = known.cell_law(effect) {
            return Some(Column { kind: EFFECT, index: 16 * law + slot, cells: Some([NO_TOUCH, NO_HOLD]), press: None });
        }
        if known.points.iter().all(|p| p.0 != effect) {
            return None;
        }
        let cells = known.on_patches().then_some([NO_TOUCH, NO_HOLD]);
        Some(Column { kind: NOTHING, index: 0, cells, press: Some((effects::column(EFFECT, slot), Some(effect))) })
    }

    /// ∂r/∂p → `column`.
    pub(crate) fn column(&mut self, column: Option<Column>) {
        let c = column.unwrap_or(Column { kind: NOTHING, index: 0, cells: None, press: None });
        if let Some([touch, hold]) = c.cells {
            self.run(pass::TOUCH_PATCHES, ALL, Per::Patch, touch);
            if let Some((question, only)) = c.press {
                self.press_patches(ALL, question, only, &[]);
            }
            self.run(pass::HOLD_CELLS, ALL, Per::Hold, hold);
            self.run(pass::PRESS_COLUMN, ALL, Per::Cell, c.kind + KINDS * c.index);
            if [YOUNGS_MODULUS, POISSON_RATIO, EFFECT, MODULUS_SLOPE, AGING_SLOPE, REST_SLOPE].contains(&c.kind) {
                self.laws(pass::COLUMN_LAWS, ALL, Per::Cell, c.kind + KINDS * c.index, &[]);
            }
        }
        let flag = if c.cells.is_some() { FLAG } else { 0 };
        self.run(pass::GATHER_COLUMN, ALL, Per::Node, c.kind + KINDS * c.index + flag);
        if let Some((question, only)) = c.press {
            self.press_nodes(ALL, question, only, &self.world.buffers["column"], &[]);
        }
    }

    /// dJ/dp −= z · ∂r/∂p for every parameter, z in `direction`.
    pub(crate) fn add_columns(&mut self) {
        let keys = self.world.plan.layout.keys.clone();
        for (p, key) in keys.iter().enumerate() {
            if let Some(column) = self.column_of(*key) {
                self.column(Some(column));
                self.run(pass::DOT_COLUMN, ALL, Per::Member, p as u32);
            }
        }
    }

    /// ∂u/∂p of the start → `column`; false for parameters that the shape at the start does not depend on.
    pub(crate) fn shape_column(&mut self, key: ParamKey) -> bool {
        let Some(row) = self.start_row(key) else { return false };
        self.column(Some(Column { kind: START_SHAPE, index: row, cells: None, press: None }));
        true
    }

    /// Row of a parameter of the stress-free shape, where the body starts in it.
    fn start_row(&self, key: ParamKey) -> Option<u32> {
        let ParamKey::Effect { effect, slot, law } = key else { return None };
        let known = &self.world.geometry.effects;
        let rest = matches!(palpate_model::effects::ALL[usize::from(law)].site, Site::Rest(_));
        known.slope_row(effect.into(), slot.into()).filter(|_| rest && known.starts_unstrained())
    }

    /// ∂v/∂p of the start → `column`; false for parameters that the velocity does not depend on.
    pub(crate) fn velocity_column(&mut self, key: ParamKey) -> bool {
        let Some((kind, index)) = self.velocity_kind(key) else { return false };
        self.column(Some(Column { kind, index, cells: None, press: None }));
        true
    }

    /// Kind and index of ∂v/∂p of the start.
    fn velocity_kind(&self, key: ParamKey) -> Option<(u32, u32)> {
        match key {
            ParamKey::Velocity(a) => Some((6, a.into())),
            ParamKey::AngularVelocity(a) => Some((7, a.into())),
            _ => self.start_row(key).map(|row| (START_SPIN, row)),
        }
    }

    /// True when a static start depends on this parameter.
    pub(crate) fn moves_equilibrium(&self, key: ParamKey) -> bool {
        self.velocity_kind(key).is_none() && self.column_of(key).is_some()
    }

    /// dJ/dp += dJ/dv · ∂v/∂p + dJ/du · ∂u/∂p of the start.
    pub(crate) fn add_start_columns(&mut self, adj: &wgpu::Buffer) {
        let keys = self.world.plan.layout.keys.clone();
        for (p, key) in keys.iter().enumerate() {
            if self.velocity_column(*key) {
                self.run_with(pass::DOT_COLUMN, ALL, Per::Member, p as u32 + FLAG, &[("probe", adj)]);
            }
            if self.shape_column(*key) {
                self.run_with(pass::DOT_COLUMN, ALL, Per::Member, p as u32 + OF_SHAPE, &[("probe", adj)]);
            }
        }
    }
}
