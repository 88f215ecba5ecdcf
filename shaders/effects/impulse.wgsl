//! Twin of palpate-model/src/effects/impulse.rs; the nodes' shares come from the host. The way stands for x: the rest does not depend on it.

fn impulse() -> Dual {
    if spot.rate == 0.0 {
        return number(0.0);
    }
    // Forces act between both states, 1 − θ of a step before the new one.
    let lead = (1.0 - spot.rate / spot.momentum) / spot.rate;
    let shrink = 4.0 * reciprocal(param(8u));
    let u = mul(z[TIME_AT] - number(lead) - param(7u), shrink);
    if u.x < 0.0 || u.x >= 4.0 {
        return number(0.0);
    }
    let a = select(u - number(2.0), number(2.0) - u, u.x < 2.0);
    var course = mul(mul(a, a), 0.5 * a - number(1.0)) + number(2.0 / 3.0);
    if a.x >= 1.0 {
        let b = number(2.0) - a;
        course = (1.0 / 6.0) * mul(mul(b, b), b);
    }
    return -mul(mul(mul(course, shrink), dot3(vector(0u), way())), measure);
}
