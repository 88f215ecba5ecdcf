//! Weights of the θ-scheme: how the two states and inertia enter a balance. Twin of `Mix` and `Inertia` of the CPU backend.
// use shared/grid

var<batch> members: array<Member>;

struct Mix {
    // Weights of the new and old state's elastic force, and β/Δt.
    fresh: f32,
    old: f32,
    rate: f32,
    // 1/(θΔt²), and α/Δt.
    inertia: f32,
    drag: f32,
    // Factor of the ghost penalty at the new state; factors of q₁ and q₀ in the force of the new pose.
    on_ghost: f32,
    on_new: f32,
    on_old: f32,
}

fn mix_of(m: Member) -> Mix {
    var x: Mix;
    x.fresh = 1.0;
    if call.mode != 0u {
        x.fresh = shape.theta;
        x.old = 1.0 - shape.theta;
        x.rate = m.stiffness_damping / shape.dt;
        x.inertia = 1.0 / (shape.theta * shape.dt * shape.dt);
        x.drag = m.mass_damping / shape.dt;
    }
    x.on_ghost = x.fresh + x.rate;
    x.on_new = x.fresh + x.rate;
    x.on_old = -x.rate;
    return x;
}
