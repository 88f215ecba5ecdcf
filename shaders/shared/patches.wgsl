//! Surface patches, each a stencil.
// use shared/stencil

// Rest position [m] and area [m²].
var<body> patches: array<vec4<f32>>;

fn patch_stencil(which: u32) -> u32 {
    return shape.first_patch + which;
}

// Weight at a corner of the cell that a patch lies in: on cut cells the stencil's entries are the corners.
fn corner_weight(which: u32, corner: u32) -> f32 {
    return stencil_entries[stencil_rows[patch_stencil(which)] + corner].weight;
}
