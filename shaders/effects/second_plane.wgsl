//! Twin of palpate-model/src/effects/second_plane.rs.

fn second_plane() -> Dual {
    let n = vector(2u);
    let distance = mul(dot3(n, x_from(vector(5u))), reciprocal(root(dot3(n, n)))) + param(1u);
    return mul(energy_of(distance, mul(param(0u), z[STIFFNESS_AT])), measure);
}
