//! du + Δt dv: how a tangent would fly on by itself.
// use shared/grid

var<storage, read> tangent: array<vec4<f32>>;
var<storage, read_write> flight: array<vec4<f32>>;

@compute @workgroup_size(64)
fn fly_tangent(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    flight[a] = tangent[a] + shape.dt * tangent[part(1u) + a];
}
