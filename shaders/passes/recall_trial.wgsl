//! Counts the increment beyond free flight back from the states of a solve, for its residual.
// use shared/flight

var<storage, read> next: array<vec4<f32>>;
var<storage, read_write> trial: array<vec4<f32>>;

@compute @workgroup_size(64)
fn recall_trial(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    trial[a] = vec4(beyond_flight(p.member, a, next[a].xyz, next[part(1u) + a].xyz), 0.0);
}
