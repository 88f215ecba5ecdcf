//! Twin of palpate-model/src/effects/slack.rs. The way stands for x: what differs does not depend on x.

fn slack() -> Dual {
    let s = mul(z[TIME_AT] - param(15u), reciprocal(param(16u)));
    if abs(s.x) >= 1.0 {
        return number(0.0);
    }
    let c = cosine(1.5707964 * s);
    let from_center = origin_from(vector(12u));
    var field = vector(0u);
    for (var k = 0u; k < 3u; k++) {
        field = add3(field, mul3(from_center[k], vector(3u + 3u * k)));
    }
    return -mul(mul(mul(c, c), dot3(field, way())), measure);
}
