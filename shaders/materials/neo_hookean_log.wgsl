//! Twin of palpate-model/src/materials/neo_hookean_log.rs.

fn neo_hookean_log(h: Gradient, lambda: Dual, mu: Dual) -> Dual {
    let parts = volume_parts(h);
    let j = parts[0] + parts[1] + parts[2];
    let ln = ln1p(j);
    return mul(shear_energy(h, parts, j), mu) + 0.5 * mul(mul(ln, ln), lambda);
}
