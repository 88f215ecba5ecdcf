//! Derivatives by the time of the start through nodes that are held: it moves their clamps.
// use shared/grid
// use shared/wanted
// use shared/pulls

var<storage, read> probe: array<vec4<f32>>;
// [B][workgroups]
var<storage, read_write> held_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    var by = 0.0;
    if p.live {
        by = dot(probe[at_node(p.member, p.item)].xyz, pull_rate(p.member, p.item));
    }
    let sum = sum64(local, vec4(by, 0.0, 0.0, 0.0)).x;
    if local == 0u && p.live {
        // The springs' pull stands in the balance with the minus sign.
        held_sums[row_at(0u, p.member, p.item, shape.nodes, 64u)] += sum;
    }
}
