//! Displacements at the looks' instants, of all extended nodes: [2][slots][N + M], a large part and the rest, as states have them.
// use shared/look

var<storage, read_write> seen: array<vec4<f32>>;

fn seen_at(slot: u32, node: u32) -> u32 {
    return slot * sight.extended + node;
}

fn rest_part() -> u32 {
    return sight.slots * sight.extended;
}

// u_b − u_a of two places: the large parts are multiples of one number, so nothing is lost.
fn between(a: u32, b: u32) -> vec3<f32> {
    return (seen[b].xyz - seen[a].xyz) + (seen[rest_part() + b].xyz - seen[rest_part() + a].xyz);
}
