//! Twin of palpate-model/src/effects/second_plane.rs.

fn second_plane() -> Dual {
    let n = vector(2u);
    let shrink = reciprocal(root(dot3(n, n)));
    let distance = mul(dot3(n, x_from(vector(5u))), shrink) + param(1u);
    let old_distance = mul(dot3(n, old_from(vector(5u))), shrink) + param(1u);
    return mul(energy_along_way(old_distance, distance, mul(param(0u), z[STIFFNESS_AT])), measure);
}
