//! Contact law of a plane. Twin of palpate-model/src/mechanics/contact.rs; all per unit stiffness.

// Points of the quadrature over a step, distance of the outer ones from its middle, and their weight (`contact::instants`).
override instant_count: u32;
override instant_offset: f32;
override instant_weight: f32;
// Weight of the new state from which on contact acts there alone.
override contact_damped: f32;

// True where contact acts along the way of a step, not in its new state alone. θ may have been made of a step's factors.
fn acts_along(theta: f32) -> bool {
    return theta <= contact_damped - 1e-6;
}

// Weight of an evaluation of the law, and its place in the step; of no weight are all but the first where the new state counts alone.
fn instant(k: u32, theta: f32) -> vec2<f32> {
    if !acts_along(theta) {
        return vec2(select(0.0, 1.0, k == 0u), 1.0);
    }
    let away = f32(k) - 1.0;
    let start = (theta - 0.5) / (contact_damped - 0.5);
    let at = start + (1.0 - start) * (0.5 + away * instant_offset);
    return vec2(select(instant_weight, 1.0 - 2.0 * instant_weight, k == 1u), at);
}

struct Law {
    pressure: f32,
    slope: f32,
    energy: f32,
}

fn contact_law(gap: f32, width: f32) -> Law {
    var l: Law;
    if gap >= width {
        return l;
    }
    if gap <= -width {
        l.pressure = -gap;
        l.slope = -1.0;
        l.energy = 0.5 * gap * gap + 0.1 * width * width;
        return l;
    }
    let s = (width - gap) / (2.0 * width);
    l.pressure = 2.0 * width * s * s * s * (1.0 - 0.5 * s);
    l.slope = -s * s * (3.0 - 2.0 * s);
    l.energy = 4.0 * width * width * s * s * s * s * (0.25 - 0.1 * s);
    return l;
}
