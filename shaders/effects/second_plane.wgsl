//! Twin of palpate-model/src/effects/second_plane.rs.

fn second_plane() -> Dual {
    let level = cosine(param(3u));
    let n = Three(mul(level, cosine(param(2u))), mul(level, sine(param(2u))), sine(param(3u)));
    let distance = dot3(n, x_from(vector(4u))) + param(1u);
    return mul(energy_of(distance, mul(param(0u), z[STIFFNESS_AT])), measure);
}
