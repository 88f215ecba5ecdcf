//! Conjugate gradients before their first iteration, a workgroup a group of nodes: the residual of a solve from zero, no way that came before, and
//! force and torque on the group. A solve that goes on is left as it is. call.extra: FOR_DIRECTION or FOR_DERIVATIVE.
// use shared/parity_called
// use shared/asks
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/solving
// use shared/coarse
// use shared/keep_pair
// use shared/newton_of

var<storage, read> residual: array<vec4<f32>>;
var<storage, read_write> solving: array<vec4<f32>>;
var<storage, read_write> cg_sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn begin_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs {
        return;
    }
    if newton_of(local, share.member).cg != 0u {
        return;
    }
    let turn = turn_of_group(share.home, share.first);
    var force = vec4(0.0);
    var torque = vec4(0.0);
    for (var k = group_rows[share.first] + local; k < group_rows[share.first + 1u]; k += 64u) {
        let node = group_nodes[k];
        let a = at_node(share.member, node);
        var r = solving[solving_part(RIGHT) + a].xyz;
        if call.extra == FOR_DIRECTION {
            r = -residual[a].xyz;
        }
        solving[a] = vec4(0.0);
        solving[solving_part(REST) + a] = vec4(r, 0.0);
        // The way before the first, which is even.
        solving[solving_part(ODD_WAY) + a] = vec4(0.0);
        let w = wrench_of(turn, arms[node], r);
        force += vec4(w.force, 0.0);
        torque += vec4(w.torque, 0.0);
    }
    keep_pair(local, wrenches_at(share.member, 1u) + 2u * share.first, force, torque);
    if share.first == 0u && local < SCALARS {
        cg_sums[scalars_at(share.member) + local] = vec4(0.0);
    }
}
