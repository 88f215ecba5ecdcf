//! Conjugate gradients by many workgroups, after the product: x ← x + α p, r ← r − α q; and force and torque that r is to each group, which is
//! what a workgroup works on.
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/precondition
// use shared/iteration
// use shared/coarse

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(64)
fn advance_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs {
        return;
    }
    let s = scalars_of(local, scalars_at(share.member) + parity());
    if s.z != 0.0 {
        return;
    }
    let bend = sum_parts(local, bends_at(share.member), groups_of_nodes(product_width()));
    let bad = bend <= 0.0 || !is_finite(bend);
    let alpha = select(s.x / bend, 0.0, bad);
    if share.first == 0u && local == 0u {
        let before = cg_sums[scalars_at(share.member) + 3u - parity()].y;
        cg_sums[scalars_at(share.member) + 2u + parity()] = vec4(select(0.0, 1.0, bad), before + alpha * s.x, 0.0, 0.0);
    }
    if bad {
        return;
    }
    set_way(parity(), 0.0);
    let turn = turn_of_group(share.home, share.first);
    var force = vec4(0.0);
    var torque = vec4(0.0);
    for (var k = group_rows[share.first] + local; k < group_rows[share.first + 1u]; k += 64u) {
        let node = group_nodes[k];
        let a = at_node(share.member, node);
        solving[a] += alpha * solving[way_now() + a];
        let r = solving[solving_part(REST) + a].xyz - alpha * solving[solving_part(IMAGE) + a].xyz;
        solving[solving_part(REST) + a] = vec4(r, 0.0);
        let w = wrench_of(turn, arms[node].xyz, r);
        force += vec4(w.force, 0.0);
        torque += vec4(w.torque, 0.0);
    }
    let whole = Wrench(total(local, force).xyz, total(local, torque).xyz);
    if local == 0u {
        let at = wrenches_at(share.member) + 2u * share.first;
        cg_sums[at] = vec4(whole.force, 0.0);
        cg_sums[at + 1u] = vec4(whole.torque, 0.0);
    }
}
