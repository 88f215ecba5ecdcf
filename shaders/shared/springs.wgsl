//! Springs of held nodes with their layers: of thickness ℓ and stiffness S/ℓ, with S = (λ + 2μ) times the area, in series with the spring.
// use shared/mix
// use shared/fields
// use shared/held

// A spring with its layer [N/m], and its derivatives by ℓ and by the logarithm of S.
struct Spring {
    stiffness: f32,
    by_layer: f32,
    by_firm: f32,
}

// λ + 2μ [Pa].
fn firm_of(m: Member, member: u32) -> f32 {
    return unvaried(m, member) * (m.lame.x + 2.0 * m.lame.y);
}

// Derivative of its logarithm by Poisson's ratio.
fn firm_by_poisson(m: Member) -> f32 {
    return (m.lame.z + 2.0 * m.lame.w) / (m.lame.x + 2.0 * m.lame.y);
}

fn spring_at(firm: f32, layer: f32, h: Holder) -> Spring {
    let s = firm * h.area;
    if layer == 0.0 {
        return Spring(h.stiffness, -h.stiffness * (h.stiffness / s), 0.0);
    }
    let share = h.stiffness / (s + h.stiffness * layer);
    return Spring(share * s, -share * share * s, share * share * layer * s);
}
