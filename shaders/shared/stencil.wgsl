//! Stencils: places of the body as weighted sums over nodes, in compressed rows. A stencil's sum of a field is Σ w v over its entries; its
//! transpose is a gather over nodes, which add what the stencils that hold them give. Twin of palpate-model/src/space/stencil.rs.
//!
//! The balance numbers its stencils through: elastic points, which alone have gradients, then surface patches, then point masses. Passes of
//! observations have the markers' sites instead.

struct Entry { // mirrored
    node: u32,
    // Weight of its value.
    weight: f32,
}

// Start of each stencil's entries.
var<body> stencil_rows: array<u32>;
var<body> stencil_entries: array<Entry>;
// Weights of the gradient [1/m], entry by entry.
var<body> stencil_gradients: array<vec4<f32>>;

// Number of an entry of a stencil at a node, or NONE.
fn entry_of(stencil: u32, node: u32) -> u32 {
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        if stencil_entries[k].node == node {
            return k;
        }
    }
    return NONE;
}
