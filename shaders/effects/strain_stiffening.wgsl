//! Twin of palpate-model/src/effects/strain_stiffening.rs.

fn strain_stiffening(which: u32) -> Dual {
    if which != ENERGY_PART {
        return number(0.0);
    }
    return mul(param(0u), mul(density(), density()));
}
