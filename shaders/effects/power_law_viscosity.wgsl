//! Twin of palpate-model/src/effects/power_law_viscosity.rs.

const POWER_LAW_VISCOSITY_SLOW = 1e-2;

fn power_law_viscosity(which: u32) -> Dual {
    if which != LOSS_PART {
        return number(0.0);
    }
    let squared = (2.0 * step_rate * step_rate) * density() + number(POWER_LAW_VISCOSITY_SLOW * POWER_LAW_VISCOSITY_SLOW);
    let power = param(1u) + number(1.0);
    return mul(mul(param(0u), exponential(0.5 * mul(logarithm(squared), power))), reciprocal(step_rate * power));
}
