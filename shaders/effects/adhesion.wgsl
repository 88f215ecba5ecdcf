//! Twin of palpate-model/src/effects/adhesion.rs.

fn adhesion() -> Dual {
    let range = param(1u);
    var depth = number(0.0);
    for (var k = 0u; k < instant_count; k++) {
        let at = along_way(k, old_gap(), gap());
        if at.weight == 0.0 {
            break;
        }
        let beyond = at.gap - number(spot.width);
        if beyond.x >= range.x {
            continue;
        }
        if beyond.x > 0.0 {
            let s = mul(range - beyond, reciprocal(range));
            let s2 = mul(s, s);
            depth += at.weight * mul(range, mul(mul(s2, s2), s2 - 3.0 * s + number(2.5)));
        } else {
            depth += at.weight * (0.5 * range - beyond);
        }
    }
    return -mul(mul(param(0u), depth), measure);
}
