//! Where a cell's part of `law_modes` lies, for laws of n scalars: see tangent_laws.

fn mode_at(member: u32, cell: u32, n: u32) -> u32 {
    return (member * shape.cells + cell) * (1u + 8u * (n + 2u) + 2u * n);
}

// r_k of a corner; r_d follows the last, and then that of the viscosity.
fn corner_mode(at: u32, n: u32, corner: u32) -> u32 {
    return at + 1u + (n + 2u) * corner;
}

// A row of the matrix.
fn row_mode(at: u32, n: u32, row: u32) -> u32 {
    return at + 1u + 8u * (n + 2u) + 2u * row;
}
