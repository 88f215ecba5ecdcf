//! Derivatives by the stress-free shape at nodes that clamps hold, which is what they hold of the body.
// use shared/held_slopes

var<storage, read> probe: array<vec4<f32>>;
// [B][N]
var<storage, read_write> rest_pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_held_shape(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    rest_pulls[a] -= vec4(by_shape(members[p.member], p.member, p.item, probe[a].xyz, true), 0.0);
}
