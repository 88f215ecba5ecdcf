//! Contact law of a plane. Twin of palpate-model/src/contact.rs; all per unit stiffness.

override contact_width: f32;

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
