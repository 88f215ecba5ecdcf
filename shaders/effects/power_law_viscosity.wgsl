//! Twin of palpate-model/src/effects/power_law_viscosity.rs, with its slowest rate of 0.01/s.

fn power_law_viscosity(which: u32) -> Dual {
    if which != LOSS_PART {
        return number(0.0);
    }
    let squared = (2.0 * step_rate * step_rate) * density() + number(1e-4);
    let power = param(1u) + number(1.0);
    return mul(mul(param(0u), exponential(0.5 * mul(logarithm(squared), power))), reciprocal(step_rate * power));
}
