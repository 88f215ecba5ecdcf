//! Twin of palpate-model/src/effects/second_plane.rs.

fn second_plane() -> Dual {
    let n = vector(2u);
    let shrink = reciprocal(root(dot3(n, n)));
    let distance = mul(dot3(n, x_from(vector(5u))), shrink) + param(1u);
    let old_distance = mul(dot3(n, old_from(vector(5u))), shrink) + param(1u);
    var energy = number(0.0);
    for (var k = 0u; k < INSTANTS; k++) {
        let at = along_way(k, old_distance, distance);
        if at.weight == 0.0 {
            break;
        }
        energy += at.weight * energy_of(at.gap, mul(param(0u), z[STIFFNESS_AT]));
    }
    return mul(energy, measure);
}
