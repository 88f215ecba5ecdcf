//! Tukey's biweight on the distance of a depth point. Twin of palpate-model/src/observation/kernel.rs.

// ρ(r) for the band c.
fn depth_cost(r: f32, c: f32) -> f32 {
    let t = (r / c) * (r / c);
    if t < 1.0 {
        return r * r * (0.5 - t * (0.5 - t / 6.0));
    }
    return depth_unmatched(c);
}

// ρ′(r)/r.
fn depth_weight(r: f32, c: f32) -> f32 {
    let t = (r / c) * (r / c);
    if t < 1.0 {
        return (1.0 - t) * (1.0 - t);
    }
    return 0.0;
}

// ρ of a point that finds no cell.
fn depth_unmatched(c: f32) -> f32 {
    return c * c / 6.0;
}
