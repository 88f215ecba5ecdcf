//! Twin of palpate-model/src/effects/point_mass.rs; the nodes' shares come from the host. The way stands for x in the weight's potential.

// Product of two motions that the load feels: of a hanging one what lies across gravity does not count.
fn felt(a: Three, b: Three) -> Dual {
    let g = gravity();
    let along = mul(mul(dot3(a, g), dot3(b, g)), reciprocal(dot3(g, g) + number(1e-12)));
    return dot3(a, b) + mul(param(5u), along - dot3(a, b));
}

fn point_mass() -> Dual {
    let s = way();
    let kinetic = (0.5 * spot.inertia) * felt(s, s) - spot.momentum * felt(velocity(), s);
    return mul(mul(param(0u), kinetic - dot3(gravity(), s)), measure);
}
