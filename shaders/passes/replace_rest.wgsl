//! Conjugate gradients by many workgroups for a derivative, now and then after an odd iteration, where the residual is said to be small: the
//! true one, r = b − A x, and force and torque that it is to each group, a workgroup each.
// use shared/parity_called
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/operand
// use shared/coarse
// use shared/keep_pair

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(64)
fn replace_rest(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs {
        return;
    }
    if !claims(local, share.member) {
        return;
    }
    let turn = turn_of_group(share.home, share.first);
    var force = vec4(0.0);
    var torque = vec4(0.0);
    for (var k = group_rows[share.first] + local; k < group_rows[share.first + 1u]; k += 64u) {
        let node = group_nodes[k];
        let a = at_node(share.member, node);
        let r = solving[solving_part(RIGHT) + a].xyz - solving[solving_part(IMAGE) + a].xyz;
        solving[solving_part(REST) + a] = vec4(r, 0.0);
        let w = wrench_of(turn, arms[node], r);
        force += vec4(w.force, 0.0);
        torque += vec4(w.torque, 0.0);
    }
    keep_pair(local, wrenches_at(share.member, 1u) + 2u * share.first, force, torque);
}
