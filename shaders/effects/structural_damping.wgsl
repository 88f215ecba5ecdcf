//! Twin of palpate-model/src/effects/structural_damping.rs, with its slowest rate of 0.01/s and smallest strain of 1e-4.

fn structural_damping(which: u32) -> Dual {
    if which != LOSS_PART {
        return number(0.0);
    }
    let slow = 1e-2 / step_rate;
    return mul(param(0u), mul(root(2.0 * old_density() + number(1e-8)), root(2.0 * density() + number(slow * slow))));
}
