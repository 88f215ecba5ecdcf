//! Laws of points: what effects do to nodes, and to patches of the surface, one pass an effect.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::points::{AT_NODES, QUESTION_AT};
use crate::device::recorder::Named;
use crate::passes::{Passes, Per};

impl Passes<'_, '_> {
    /// Asks every effect on nodes (or the one of number `only`) and adds its answer to `forces`, or to the matrix.
    pub(crate) fn press_nodes(&mut self, section: u32, question: u32, only: Option<usize>, forces: &wgpu::Buffer, more: &Named) {
        let named: Vec<_> = more.iter().copied().chain([("forces", forces)]).collect();
        self.press(pass::PRESS_NODES, Per::Node, [section, question], only, &named);
    }

    /// Asks every effect on patches (or the one of number `only`) and adds its answer to what the planes' pass left.
    pub(crate) fn press_patches(&mut self, section: u32, question: u32, only: Option<usize>, more: &Named) {
        self.press(pass::PRESS_PATCHES, Per::Patch, [section, question], only, more);
    }

    fn press(&mut self, pass: usize, per: Per, [section, question]: [u32; 2], only: Option<usize>, more: &Named) {
        let world = self.world;
        for (k, (number, site)) in world.geometry.effects.points.iter().enumerate() {
            if (site.site == AT_NODES) == matches!(per, Per::Node) && only.is_none_or(|o| o == *number) {
                self.run_with(pass, section, per, k as u32 + (question << QUESTION_AT), more);
            }
        }
    }
}
