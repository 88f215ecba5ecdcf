//! Twin of palpate-model/src/effects/contact_stiffness.rs.

fn contact_stiffness() -> Dual {
    var energy = number(0.0);
    for (var k = 0u; k < INSTANTS; k++) {
        let at = along_way(k, old_gap(), gap());
        if at.weight == 0.0 {
            break;
        }
        energy += at.weight * energy_of(at.gap, z[PLANE_AT + 4u]);
    }
    return mul(mul(param(0u), energy), measure);
}
