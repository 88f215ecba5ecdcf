//! Change of what holds nodes along a direction: a later start moves their clamps.
// use shared/mix
// use shared/wanted
// use shared/rates

var<storage, read_write> column: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if p.live && is_held(p.item) {
        column[at_node(p.member, p.item)] -= vec4(rates[p.member].start * pull_rate(p.member, p.item), 0.0);
    }
}
