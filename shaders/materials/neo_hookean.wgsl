//! Twin of palpate-model/src/materials/neo_hookean.rs.

fn neo_hookean(h: Gradient, lambda: Dual, mu: Dual) -> Dual {
    let parts = volume_parts(h);
    let j = parts[0] + parts[1] + parts[2];
    return mul(shear_energy(h, parts, j), mu) + 0.5 * mul(0.5 * mul(j, j) + minus_ln1p(j), lambda);
}
