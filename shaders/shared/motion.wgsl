//! How nodes move in a step, as derivatives by what multiplies their mass need it.
// use shared/stencil

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

fn acceleration_at(member: u32, stencil: u32, m: Member) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        sum += stencil_entries[k].weight * acceleration(member, stencil_entries[k].node, m);
    }
    return sum;
}

// (u₁ − u₀)/Δt.
fn speed(member: u32, node: u32) -> vec3<f32> {
    let a = at_node(member, node);
    return ((next[a].xyz - now[a].xyz) + (next[part(1u) + a].xyz - now[part(1u) + a].xyz)) / shape.dt;
}
