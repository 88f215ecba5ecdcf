//! Twin of palpate-model/src/effects/contact_stiffness.rs.

fn contact_stiffness() -> Dual {
    return mul(mul(param(0u), energy_of(gap(), z[PLANE_AT + 4u])), measure);
}
