//! Twin of palpate-model/src/effects/coulomb_friction.rs.

const COULOMB_FRICTION_CREEP = 5e-3;

fn coulomb_friction() -> Dual {
    if spot.rate == 0.0 {
        return number(0.0);
    }
    let s = way();
    let n = normal();
    let slide = sub3(s, mul3(dot3(s, n), n));
    let creep = COULOMB_FRICTION_CREEP / spot.rate;
    let length = root(dot3(slide, slide) + number(creep * creep));
    return mul(mul(mul(param(0u), old_pressure()), length), measure);
}
