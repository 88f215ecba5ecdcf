//! Twin of palpate-model/src/materials/stable_neo_hookean.rs.

fn stable_neo_hookean(h: Gradient, lambda: Dual, mu: Dual) -> Dual {
    let m = (4.0 / 3.0) * mu;
    let l = lambda + (5.0 / 6.0) * mu;
    let parts = volume_parts(h);
    let j = parts[0] + parts[1] + parts[2];
    let x = 0.5 * parts[0] + 0.25 * squares(h);
    let shear = 0.5 * squares(h) - parts[1] - parts[2];
    return 0.5 * mul(mul(j, j), l) + 0.75 * mul(shear, m) + 0.5 * mul(minus_ln1p(x), m);
}
