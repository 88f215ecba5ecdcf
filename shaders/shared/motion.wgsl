//! How nodes move in a step, as derivatives by what multiplies their mass need it.

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;

// w/(θΔt²), w the increment beyond free flight: the acceleration that forces caused, minus gravity's share; static: −g.
fn acceleration(member: u32, node: u32, m: Member) -> vec3<f32> {
    if call.mode == 0u {
        return -m.gravity.xyz;
    }
    let v = part(2u) + at_node(member, node);
    return (next[v].xyz - now[v].xyz) / shape.dt - m.gravity.xyz;
}

// (u₁ − u₀)/Δt.
fn speed(member: u32, node: u32) -> vec3<f32> {
    let a = at_node(member, node);
    return ((next[a].xyz - now[a].xyz) + (next[part(1u) + a].xyz - now[part(1u) + a].xyz)) / shape.dt;
}
