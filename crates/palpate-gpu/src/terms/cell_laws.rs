//! Laws of cells, which stand beside the material's own; a plan without any has none of these passes.

use crate::device::recorder::Named;
use crate::passes::{Passes, Per};

impl Passes<'_, '_> {
    /// A pass of the laws of cells, where there are any.
    pub(crate) fn laws(&mut self, pass: usize, section: u32, per: Per, extra: u32, more: &Named) {
        if self.world.geometry.effects.on_cells() {
            self.run_with(pass, section, per, extra, more);
        }
    }
}
