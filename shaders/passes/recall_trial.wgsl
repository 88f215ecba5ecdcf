//! Counts the increment beyond free flight back from the states of a solve, for its residual.
// use shared/mix

var<storage, read> now: array<vec4<f32>>;
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
    var w = next[a].xyz + next[part(1u) + a].xyz;
    if call.mode != 0u {
        // As place_next counts it.
        let flight = shape.dt * now[part(2u) + a].xyz + shape.theta * shape.dt * shape.dt * members[p.member].gravity.xyz;
        w = (next[a].xyz - now[a].xyz) + (next[part(1u) + a].xyz - now[part(1u) + a].xyz) - flight;
    }
    trial[a] = vec4(w, 0.0);
}
