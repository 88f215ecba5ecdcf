//! Twin of palpate-model/src/effects/tether.rs; the nodes' shares come from the host. The way stands for x where x is linear.

fn tether() -> Dual {
    let offset = sub3(vector(1u), vector(4u));
    let stretch = add3(moved(), offset);
    var theta = 1.0;
    if spot.momentum != 0.0 {
        theta = spot.rate / spot.momentum;
    }
    let energy = (0.5 * theta) * dot3(stretch, stretch) + (1.0 - theta) * dot3(add3(old_moved(), offset), way());
    return mul(mul(param(0u), energy), measure);
}
