//! The residual penalty of stars, ½ γ μ_i u·A_i u each (palpate-model/src/space/stars/penalty.rs). Rows of A sum to zero, so that differences of
//! displacements do, and a long way costs no digits.
// use shared/mix
// use shared/fields
// use shared/stencil

// Start of each star's entries.
var<body> brace_rows: array<u32>;
// γ A [m], row by row, star after star.
var<body> braces: array<f32>;

fn has_stars() -> bool {
    return (shape.fields & FIELD_STARS) != 0u;
}

fn end_of_star(star: u32) -> u32 {
    return stencil_rows[star + 1u];
}

// Entry of γ A of a star at two entries of its stencil.
fn brace_at(star: u32, row: u32, column: u32) -> f32 {
    let first = stencil_rows[star];
    let n = stencil_rows[star + 1u] - first;
    return braces[brace_rows[star] + (row - first) * n + column - first];
}
