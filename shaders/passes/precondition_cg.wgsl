//! z = M⁻¹ r, a workgroup a group of nodes: their own blocks, and the group's motion from force and torque on all groups; and parts of rᵀ z.
//! call.extra: ODD after an odd iteration, and before the first one.
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/iteration
// use shared/correction

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(64)
fn precondition_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs || scalars_of(local, scalars_at(share.member) + parity()).z != 0.0 {
        return;
    }
    let own = share.first;
    let choice = coarse_choice(share.home);
    let wrenches = wrenches_at(share.member);
    var sum: Motion;
    for (var g = local; g < shape.groups; g += 64u) {
        sum = add_motion(sum, u32(choice.x), g, own, Wrench(cg_sums[wrenches + 2u * g].xyz, cg_sums[wrenches + 2u * g + 1u].xyz));
    }
    let motion = motion_of(Motion(total(local, sum.upper), total(local, sum.lower)), choice.y);
    let turn = turn_of_group(share.home, own);
    var left = vec4(0.0);
    for (var k = group_rows[own] + local; k < group_rows[own + 1u]; k += 64u) {
        let node = group_nodes[k];
        let a = at_node(share.member, node);
        let r = solving[solving_part(REST) + a].xyz;
        let z = scaled(at_node(share.home, node), r) + carried(turn, arms[node].xyz, motion);
        solving[solving_part(SCALED) + a] = vec4(z, 0.0);
        left.x += dot(r, z);
    }
    let rz = total(local, left).x;
    if local == 0u {
        cg_sums[rests_at(share.member) + own] = vec4(rz, 0.0, 0.0, 0.0);
    }
}
