//! Stiffness of a cell where effects vary it over the body; without such effects the factors are not read.

// [B][cells], times Young's modulus.
var<storage, read> moduli: array<f32>;

fn young_at(m: Member, member: u32, cell: u32) -> f32 {
    if (shape.fields & 1u) != 0u {
        return m.young * moduli[member * shape.cells + cell];
    }
    return m.young;
}
