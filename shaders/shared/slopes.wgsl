//! Derivatives of a cell's stiffness by the parameters of effects.
// use shared/fields

// [B][rows][cells]: derivatives of the cells' factors.
var<storage, read> modulus_slopes: array<f32>;

// By the parameter in this row of a field over the body.
fn modulus_slope(m: Member, member: u32, cell: u32, row: u32) -> f32 {
    var young = m.young * modulus_slopes[(member * shape.slope_rows + row) * shape.cells + cell];
    if (shape.fields & FIELD_AGING) != 0u {
        young *= aging_at(member, 0u);
    }
    return young;
}

// By the parameter in this row of a change in time.
fn aging_slope(m: Member, member: u32, cell: u32, row: u32) -> f32 {
    var young = m.young * aging_at(member, 1u + row);
    if (shape.fields & FIELD_MODULUS) != 0u {
        young *= moduli[member * shape.cells + cell];
    }
    return young;
}
