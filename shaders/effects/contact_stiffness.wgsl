//! Twin of palpate-model/src/effects/contact_stiffness.rs.

fn contact_stiffness() -> Dual {
    return mul(mul(param(0u), energy_along_way(old_gap(), gap(), z[PLANE_AT + 4u])), measure);
}
