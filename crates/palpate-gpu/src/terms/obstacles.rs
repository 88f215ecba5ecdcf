//! Contact of surface patches with obstacles that a file moves; it adds to what planes left there.

use super::{Along, Past, Pull, Term, Way, seeks_effect};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};
use palpate_model::effects::Site;
use palpate_model::mechanics::contact::acts_along;

pub(super) struct Obstacles;

impl Passes<'_, '_> {
    fn press_obstacles(&mut self, section: u32, ask: u32, more: &Named) {
        if self.world.geometry.shape.obstacles != 0 {
            self.run_with(pass::PRESS_OBSTACLES, section, Per::Patch, ask, more);
        }
    }

    /// True where the gap of the old state matters.
    fn feels_way(&self) -> bool {
        let stages = self.world.plan.clock.stages();
        self.step.and_then(|k| stages.get(k)).is_some_and(|s| acts_along(s.theta))
    }
}

impl Term for Obstacles {
    fn residual(&self, s: &mut Passes, section: u32) {
        s.press_obstacles(section, asks::TOUCH_FORCE, &[]);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        s.press_obstacles(section, asks::TOUCH_STIFFNESS, &[]);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.feels_way() {
            let ask = match past.way {
                Way::Along { .. } => asks::TOUCH_OLD,
                Way::Back { .. } => asks::TOUCH_BACK,
            };
            s.press_obstacles(ALL, ask, &past.named());
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.obstacles {
            s.press_obstacles(ALL, asks::TOUCH_ALONG, &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let sought = pull.sought().start || seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Obstacle));
        if sought && s.world.geometry.shape.obstacles != 0 {
            s.run_with(pass::PULL_OBSTACLES, ALL, Per::Patch, 0, &pull.named);
        }
    }
}
