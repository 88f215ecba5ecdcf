//! Twin of palpate-model/src/effects/air_drag.rs.

const AIR_DRAG_SMOOTH = 1e-6;

fn air_drag() -> Dual {
    if spot.rate == 0.0 {
        return number(0.0);
    }
    let s = way();
    let square = dot3(s, s) + number(AIR_DRAG_SMOOTH * AIR_DRAG_SMOOTH);
    let cube = mul(square, root(square));
    return (spot.rate * spot.rate / 6.0) * mul(mul(mul(param(0u), param(1u)), cube), measure);
}
