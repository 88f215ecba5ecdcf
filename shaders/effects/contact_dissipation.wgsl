//! Twin of palpate-model/src/effects/contact_dissipation.rs.

fn contact_dissipation() -> Dual {
    if spot.rate == 0.0 {
        return number(0.0);
    }
    let approach = dot3(way(), normal());
    return (0.5 * spot.rate) * mul(mul(mul(param(0u), old_pressure()), mul(approach, approach)), measure);
}
