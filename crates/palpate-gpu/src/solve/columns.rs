//! ∂r/∂p on the device: which passes make the column of each parameter, for tangents.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks::{
    HOLD_AGING, HOLD_GRIP, HOLD_MATRIX, HOLD_POISSON, HOLD_REST, HOLD_ROW, HOLD_SLOPE, HOLD_TIME, HOLD_YOUNG, NO_HOLD, NO_TOUCH,
    PLANE_ASKS, PLANE_HEIGHT, PLANE_PHI, PLANE_THETA, TOUCH_YOUNG,
};
use crate::device::pipelines::shared::keys::{
    AGING_SLOPE, ANGULAR_VELOCITY, DENSITY, DENSITY_SLOPE, EFFECT, GRAVITY, KEYS, MASS_DAMPING, MODULUS_SLOPE, NOTHING, OF_CELLS,
    PLANE, POINT_MASS, POISSON_RATIO, REST_SLOPE, SLOTS, START_SHAPE, START_SPIN, STIFFNESS_DAMPING, TIME_START, VELOCITY,
    YOUNGS_MODULUS,
};
use crate::passes::{ALL, Passes, Per};
use crate::terms::point_laws;
use palpate_model::effects::Site;
use palpate_model::params::ParamKey;

/// How a parameter enters the balance: numbers of `shared/keys.wgsl` and `shared/asks.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Column {
    kind: u32,
    index: u32,
    /// What the passes of cells, patches and clamps are told; `None` = the parameter acts on nodes alone.
    cells: Option<[u32; 2]>,
    /// The question to effects on points, and the effect that is asked where it is a single one.
    press: Option<(u32, Option<usize>)>,
}

impl Passes<'_, '_> {
    /// How a parameter enters this balance, or `None`.
    pub(crate) fn column_of(&self, key: ParamKey) -> Option<Column> {
        let dynamic = self.step.is_some();
        let column = |kind, index: u32, cells| Some(Column { kind, index, cells, press: None });
        let plane = |what: u32, i: u16| {
            let index = PLANE_ASKS * u32::from(i) + what;
            let press = Some((point_laws::question(PLANE, index), None));
            Some(Column { kind: PLANE, index: 0, cells: Some([index, NO_HOLD]), press })
        };
        // Effects on points answer to these as well.
        let pressed =
            |kind, index, cells| Some(Column { kind, index, cells, press: Some((point_laws::question(kind, index), None)) });
        match key {
            ParamKey::YoungsModulus => pressed(YOUNGS_MODULUS, 0, Some([TOUCH_YOUNG, HOLD_YOUNG])),
            ParamKey::PoissonRatio => column(POISSON_RATIO, 0, Some([NO_TOUCH, HOLD_POISSON])),
            ParamKey::Density => column(DENSITY, 0, None),
            ParamKey::MassDamping if dynamic => column(MASS_DAMPING, 0, None),
            ParamKey::StiffnessDamping if dynamic => column(STIFFNESS_DAMPING, 0, Some([NO_TOUCH, NO_HOLD])),
            ParamKey::Gravity(a) => pressed(GRAVITY, a.into(), None),
            ParamKey::TimeStart if self.world.plan.clamps.iter().any(|c| c.motion.is_some()) => {
                pressed(TIME_START, 0, Some([NO_TOUCH, HOLD_TIME]))
            }
            ParamKey::TimeStart if !self.world.geometry.effects.points.is_empty() => pressed(TIME_START, 0, None),
            ParamKey::PlaneHeight(i) => plane(PLANE_HEIGHT, i),
            ParamKey::PlaneTheta(i) => plane(PLANE_THETA, i),
            ParamKey::PlanePhi(i) => plane(PLANE_PHI, i),
            ParamKey::PointMass(i) => column(POINT_MASS, i.into(), None),
            ParamKey::Effect { effect, slot, law } => self.column_of_effect(effect.into(), slot.into(), law.into()),
            _ => None,
        }
    }

    fn column_of_effect(&self, effect: usize, slot: u32, law: usize) -> Option<Column> {
        let known = &self.world.geometry.effects;
        if let Some(row) = known.slope_row(effect, slot) {
            return Some(match palpate_model::effects::ALL[law].site {
                Site::Modulus(_) => {
                    let cells = Some([NO_TOUCH, HOLD_SLOPE + HOLD_ROW * row]);
                    Column { kind: MODULUS_SLOPE, index: row, cells, press: None }
                }
                Site::Aging(_) => {
                    let cells = Some([NO_TOUCH, HOLD_AGING + HOLD_ROW * row]);
                    Column { kind: AGING_SLOPE, index: row, cells, press: None }
                }
                Site::Rest(_) => {
                    let cells = Some([NO_TOUCH, HOLD_REST + HOLD_ROW * row]);
                    Column { kind: REST_SLOPE, index: row, cells, press: None }
                }
                Site::Clamps(_) | Site::Edges(_) => {
                    let matrix = known.matrix_row(row).map_or(0, |k| (k + 1) * HOLD_MATRIX);
                    let cells = Some([NO_TOUCH, HOLD_GRIP + HOLD_ROW * row + matrix]);
                    Column { kind: NOTHING, index: 0, cells, press: None }
                }
                _ => Column { kind: DENSITY_SLOPE, index: row, cells: None, press: None },
            });
        }
        if let Some(law) = known.cell_law(effect) {
            return Some(Column { kind: EFFECT, index: SLOTS * law + slot, cells: Some([NO_TOUCH, NO_HOLD]), press: None });
        }
        if known.points.iter().all(|p| p.0 != effect) {
            return None;
        }
        let cells = known.on_patches().then_some([NO_TOUCH, NO_HOLD]);
        Some(Column { kind: NOTHING, index: 0, cells, press: Some((point_laws::question(EFFECT, slot), Some(effect))) })
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
            self.run(pass::PRESS_COLUMN, ALL, Per::Cell, c.kind + KEYS * c.index);
            if [YOUNGS_MODULUS, POISSON_RATIO, EFFECT, MODULUS_SLOPE, AGING_SLOPE, REST_SLOPE].contains(&c.kind) {
                self.laws(pass::COLUMN_LAWS, ALL, Per::Cell, c.kind + KEYS * c.index, &[]);
            }
        }
        let flag = if c.cells.is_some() { OF_CELLS } else { 0 };
        self.run(pass::GATHER_COLUMN, ALL, Per::Node, c.kind + KEYS * c.index + flag);
        if let Some((question, only)) = c.press {
            self.press_nodes(ALL, question, only, &self.world.buffers["column"], &[]);
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
            ParamKey::Velocity(a) => Some((VELOCITY, a.into())),
            ParamKey::AngularVelocity(a) => Some((ANGULAR_VELOCITY, a.into())),
            _ => self.start_row(key).map(|row| (START_SPIN, row)),
        }
    }

    /// True when a static start depends on this parameter.
    pub(crate) fn moves_equilibrium(&self, key: ParamKey) -> bool {
        self.velocity_kind(key).is_none() && self.column_of(key).is_some()
    }
}
