//! Twin of palpate-model/src/effects/adhesion.rs.

fn adhesion() -> Dual {
    let range = param(1u);
    let beyond = gap() - number(spot.width);
    if beyond.x >= range.x {
        return number(0.0);
    }
    var depth = 0.5 * range - beyond;
    if beyond.x > 0.0 {
        let s = mul(range - beyond, reciprocal(range));
        let s2 = mul(s, s);
        depth = mul(range, mul(mul(s2, s2), s2 - 3.0 * s + number(2.5)));
    }
    return -mul(mul(param(0u), depth), measure);
}
