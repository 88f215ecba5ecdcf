//! ∂r/∂p on the device: which passes make the column of each parameter, for the adjoint (dotted with z) and for tangents.

use crate::pipelines::pass;
use crate::solve::{ALL, Per, Solve};
use palpate_model::params::ParamKey;

/// How a parameter enters the balance: numbers of `shared/keys.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Column {
    kind: u32,
    index: u32,
    /// What the passes of cells, patches and clamps are told; `None` = the parameter acts on nodes alone.
    cells: Option<[u32; 2]>,
}

/// Patches and clamps that have no part in a column.
const NO_TOUCH: u32 = 5;
const NO_HOLD: u32 = 6;
/// A kind that no kernel knows: the column is zero.
const NOTHING: u32 = 15;
/// Added to a node pass' argument: cells take part; added to the sum's argument: ∂v/∂p of the start.
const FLAG: u32 = 1 << 16;

impl Solve<'_, '_> {
    /// How a parameter enters this balance, or `None`.
    pub(crate) fn column_of(&self, key: ParamKey) -> Option<Column> {
        let dynamic = self.step.is_some();
        let nodes = |kind, index: u32| Some(Column { kind, index, cells: None });
        let plane = |what: u32, i: u16| Some(Column { kind: 9, index: 0, cells: Some([8 * u32::from(i) + what, NO_HOLD]) });
        match key {
            ParamKey::YoungsModulus => Some(Column { kind: 0, index: 0, cells: Some([1, 2]) }),
            ParamKey::PoissonRatio => Some(Column { kind: 1, index: 0, cells: Some([NO_TOUCH, 3]) }),
            ParamKey::Density => nodes(2, 0),
            ParamKey::MassDamping if dynamic => nodes(3, 0),
            ParamKey::StiffnessDamping if dynamic => Some(Column { kind: 4, index: 0, cells: Some([NO_TOUCH, NO_HOLD]) }),
            ParamKey::Gravity(a) => nodes(5, a.into()),
            ParamKey::TimeStart if self.world.plan.clamps.iter().any(|c| c.motion.is_some()) => {
                Some(Column { kind: 8, index: 0, cells: Some([NO_TOUCH, 4]) })
            }
            ParamKey::PlaneHeight(i) => plane(2, i),
            ParamKey::PlaneTheta(i) => plane(3, i),
            ParamKey::PlanePhi(i) => plane(4, i),
            ParamKey::PointMass(i) => nodes(10, i.into()),
            // The rest does not enter a balance; a build refuses plans with effects.
            _ => None,
        }
    }

    /// ∂r/∂p → `column`.
    pub(crate) fn column(&mut self, column: Option<Column>) {
        let c = column.unwrap_or(Column { kind: NOTHING, index: 0, cells: None });
        if let Some([touch, hold]) = c.cells {
            self.run(pass::TOUCH_PATCHES, ALL, Per::Patch, touch);
            self.run(pass::HOLD_CELLS, ALL, Per::Hold, hold);
            self.run(pass::PRESS_COLUMN, ALL, Per::Cell, c.kind);
        }
        let flag = if c.cells.is_some() { FLAG } else { 0 };
        self.run(pass::GATHER_COLUMN, ALL, Per::Node, c.kind + 16 * c.index + flag);
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

    /// ∂v/∂p of the start for initial velocities → `column`; false for other parameters.
    pub(crate) fn velocity_column(&mut self, key: ParamKey) -> bool {
        let (kind, axis) = match key {
            ParamKey::Velocity(a) => (6, a),
            ParamKey::AngularVelocity(a) => (7, a),
            _ => return false,
        };
        self.column(Some(Column { kind, index: axis.into(), cells: None }));
        true
    }

    /// dJ/dp += dJ/dv · ∂v/∂p of the start.
    pub(crate) fn add_velocity_columns(&mut self, adj: &wgpu::Buffer) {
        let keys = self.world.plan.layout.keys.clone();
        for (p, key) in keys.iter().enumerate() {
            if self.velocity_column(*key) {
                self.run_with(pass::DOT_COLUMN, ALL, Per::Member, p as u32 + FLAG, &[("probe", adj)]);
            }
        }
    }
}
