//! Twin of palpate-model/src/effects/structural_damping.rs.

const STRUCTURAL_DAMPING_SLOW = 1e-2;
const STRUCTURAL_DAMPING_SMALL = 1e-4;

fn structural_damping(which: u32) -> Dual {
    if which != LOSS_PART {
        return number(0.0);
    }
    let slow = STRUCTURAL_DAMPING_SLOW / step_rate;
    let small = STRUCTURAL_DAMPING_SMALL;
    return mul(param(0u), mul(root(2.0 * old_density() + number(small * small)), root(2.0 * density() + number(slow * slow))));
}
