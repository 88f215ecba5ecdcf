//! Stencils as the device has them (`shaders/shared/stencil.wgsl`): compressed rows of entries, with gradients where there are any.

use crate::device::Arena;
use crate::layout::Entry;
use palpate_model::space::stencil::Stencil;

/// Stencils in compressed rows.
#[derive(Clone, Debug)]
pub(crate) struct StencilTable {
    /// Start of each stencil's entries, and one past the last.
    pub(crate) rows: Vec<u32>,
    /// Nodes with their weights.
    pub(crate) entries: Vec<Entry>,
    /// Weights of the gradient [1/m], entry by entry; entries without one come last.
    pub(crate) gradients: Vec<[f32; 4]>,
}

impl Default for StencilTable {
    fn default() -> StencilTable {
        StencilTable { rows: vec![0], entries: Vec::new(), gradients: Vec::new() }
    }
}

impl StencilTable {
    /// Adds stencils; those with gradients before all others.
    pub(crate) fn extend<'a>(&mut self, stencils: impl Iterator<Item = Stencil<'a>>) {
        for s in stencils {
            debug_assert!(s.gradient.is_empty() || self.gradients.len() == self.entries.len());
            self.entries.extend(s.nodes.iter().zip(s.value).map(|(node, w)| Entry { node: *node, weight: *w as f32 }));
            self.gradients.extend(s.gradient.iter().map(|g| g.as_vec3().extend(0.0).to_array()));
            self.rows.push(self.entries.len() as u32);
        }
    }

    /// Number of stencils.
    pub(crate) fn len(&self) -> usize {
        self.rows.len() - 1
    }

    /// Most entries of a stencil.
    pub(crate) fn longest(&self) -> usize {
        self.rows.windows(2).map(|w| (w[1] - w[0]) as usize).max().unwrap_or(0)
    }

    /// Adds them to an arena, under the names that passes know stencils by.
    pub(crate) fn put(&self, tables: &mut Arena) {
        tables.put("stencil_rows", &self.rows);
        tables.put("stencil_entries", &self.entries);
        tables.put("stencil_gradients", &self.gradients);
    }
}
