//! The material's viscosity: a potential of the squared increment |ΔE|² of an objective strain. Twin of palpate-model/src/materials/viscosity.rs.

// Rate below which the law turns linear [1/s].
const SLOW_FLOW = 1e-2;

fn flow_measure(squared: f32) -> f32 {
    let rate = 1.0 / shape.dt;
    return 2.0 * squared * rate * rate + SLOW_FLOW * SLOW_FLOW;
}

// φ [J/m³] with its first and second derivative by the squared increment; nothing in a static problem.
fn flow_loss(m: Member, squared: f32) -> vec3<f32> {
    if call.mode == 0u || m.flow.x == 0.0 {
        return vec3(0.0);
    }
    let rate = 1.0 / shape.dt;
    let g = flow_measure(squared);
    let p = 0.5 * (m.flow.y + 1.0);
    let first = m.flow.x * rate * pow(g, p - 1.0);
    return vec3(first * g / (2.0 * p * rate * rate), first, first * (p - 1.0) * 2.0 * rate * rate / g);
}

// Second derivative of a dissipation that a tangent has; the majorised one has no negative curvature.
fn of_dissipation(majorised: bool, second: f32) -> f32 {
    return select(second, max(second, 0.0), majorised);
}

// Derivatives of φ's first derivative by η and h.
fn flow_by_numbers(m: Member, squared: f32) -> vec2<f32> {
    if call.mode == 0u {
        return vec2(0.0);
    }
    let g = flow_measure(squared);
    let by_coefficient = pow(g, 0.5 * (m.flow.y - 1.0)) / shape.dt;
    return vec2(by_coefficient, m.flow.x * by_coefficient * 0.5 * log(g));
}
