//! Change of the balance along a direction of its coefficients: (∂r/∂c) c', in one pass a term, whether the direction is one parameter's or any.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::points::COLUMN;
use crate::device::pipelines::shared::pulls::{MATRICES_AT, POSES_AT};
use crate::device::pipelines::shared::rates::WITH_CELLS;
use crate::passes::{ALL, Passes, Per};
use crate::world::Rates;
use palpate_model::effects::Site;
use palpate_model::params::coefficients::Sought;

impl Passes<'_, '_> {
    /// (∂r/∂c) c' → `column`.
    pub(crate) fn push(&mut self, rates: &Rates) {
        let (moved, named) = (&rates.moved, rates.named());
        let effects = &self.world.geometry.effects;
        let on = |s: &Self, site: fn(&Site) -> bool| s.seeks_effect(moved, site);
        let body = moved.modulus || moved.poisson || moved.rest;
        let grips = on(self, |s| matches!(s, Site::Clamps(_) | Site::Edges(_)));
        let clamps = body || grips || moved.start;
        let laws = on(self, |s| matches!(s, Site::Cells(_)));
        let planes = moved.planes || moved.modulus;
        let points = self.moves_points(moved);
        let patches = planes || (points && effects.on_patches());
        let cells = body || moved.damping[1] || clamps || patches || laws;
        if cells {
            if patches {
                self.run_with(pass::PUSH_PATCHES, ALL, Per::Patch, rates.flags, &named);
                self.press_patches(ALL, COLUMN, None, &named);
            } else {
                self.run(pass::TOUCH_PATCHES, ALL, Per::Patch, asks::NO_TOUCH);
            }
            if clamps {
                let numbers = if grips { self.world.geometry.effects.hold_numbers() } else { [0; 2] };
                let extra = rates.flags | numbers[0] << POSES_AT | numbers[1] << MATRICES_AT;
                self.run_with(pass::PUSH_HOLDS, ALL, Per::Hold, extra, &named);
            } else {
                self.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::NO_HOLD);
            }
            self.run_with(pass::PUSH_CELLS, ALL, Per::Cell, rates.flags, &named);
            if body || laws {
                self.laws(pass::PUSH_LAWS, ALL, Per::Cell, rates.flags, &named);
            }
        }
        let flags = rates.flags | if cells { WITH_CELLS } else { 0 };
        self.run_with(pass::PUSH_NODES, ALL, Per::Node, flags, &named);
        if cells {
            self.push_elastic(rates.flags, moved.start, &named);
        }
        if points {
            self.press_nodes(ALL, COLUMN, None, &self.world.buffers["column"], &named);
        }
    }

    /// Tangent of the start's shape and velocity → `part`.
    pub(crate) fn push_start(&mut self, rates: &Rates, part: &wgpu::Buffer) {
        let named: Vec<_> = [("tangent", part)].into_iter().chain(rates.named()).collect();
        self.run_with(pass::PUSH_START, ALL, Per::Node, rates.flags, &named);
    }

    /// True when laws of points depend on what changes.
    fn moves_points(&self, moved: &Sought) -> bool {
        let points = &self.world.geometry.effects.points;
        let shared = moved.gravity || moved.modulus || moved.start || moved.planes;
        !points.is_empty() && (shared || points.iter().any(|p| moved.effects[p.0]))
    }
}
