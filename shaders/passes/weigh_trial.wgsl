//! What judge_trial decides by, in parts: the residual's squared norm, the potential and the sizes of its shares, and the slope along the direction.
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/node_parts

var<storage, read> residual: array<vec4<f32>>;
// The solution of a solve comes first.
var<storage, read> solving: array<vec4<f32>>;
var<storage, read> newton: array<Newton>;

@compute @workgroup_size(64)
fn weigh_trial(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, 64u);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    var state = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        let r = residual[a];
        state = vec4(0.0, r.w, residual[part(1u) + a].w, 0.0);
        // Of the first trial there is no direction yet, and no inverse.
        if newton[p.member].length != 0.0 {
            state.x = dot(r.xyz, scaled(a, r.xyz));
            state.w = dot(r.xyz, solving[a].xyz);
        }
    }
    keep_part(local, share, 0u, total(local, state));
}
