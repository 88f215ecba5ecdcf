//! Twin of palpate-model/src/effects/point_mass.rs; the nodes' shares come from the host. The way stands for x in the weight's potential.

fn point_mass() -> Dual {
    let s = way();
    let kinetic = (0.5 * spot.inertia) * dot3(s, s) - spot.momentum * dot3(velocity(), s);
    return mul(mul(param(0u), kinetic - dot3(gravity(), s)), measure);
}
