//! The vector `probe` at a stencil.
// use shared/stencil

var<storage, read> probe: array<vec4<f32>>;

fn probe_at(member: u32, stencil: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        sum += stencil_entries[k].weight * probe[at_node(member, stencil_entries[k].node)].xyz;
    }
    return sum;
}
