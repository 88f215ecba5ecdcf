//! Stiffness of a cell where effects vary it over the body or in time; without such effects the factors are not read.

// [B][elements], times Young's modulus.
var<batch> moduli: array<f32>;
// [1 + rows][B][steps + 1]: factor on the whole body's modulus at the start and in every step, then its derivatives.
var<batch> agings: array<f32>;

// Where a matrix of a clamp cell starts in `hold_elements`: [slot][K, dK/dν][clamp cell][24 · 24]; where effects act on clamps
// every member has its own, and [rows][B][clamp cell] derivatives of K by their parameters follow.
fn grip_at(m: Member, member: u32, which: u32, hold: u32) -> u32 {
    let slot = select(m.slot, member, (shape.fields & FIELD_GRIPS) != 0u);
    return ((slot * 2u + which) * shape.holds + hold) * 576u;
}

fn aging_at(member: u32, row: u32) -> f32 {
    return agings[(row * shape.members + member) * (shape.steps + 1u) + call.step + call.mode];
}

// Young's modulus of cells without a factor of their own.
fn unvaried(m: Member, member: u32) -> f32 {
    var young = m.young;
    if (shape.fields & FIELD_AGING) != 0u {
        young *= aging_at(member, 0u);
    }
    return young;
}

fn young_at(m: Member, member: u32, element: u32) -> f32 {
    var young = m.young;
    if (shape.fields & FIELD_MODULUS) != 0u {
        young *= moduli[member * shape.elements + element];
    }
    if (shape.fields & FIELD_AGING) != 0u {
        young *= aging_at(member, 0u);
    }
    return young;
}
