//! Change of what holds nodes along a direction: a later start moves their clamps, and so do numbers of effects, which make their layers as well;
//! these are as stiff as the body.
// use shared/held_slopes
// use shared/rates

// [B][N]: of the stress-free shape.
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> column: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live || held_rows[p.item] == held_rows[p.item + 1u] {
        return;
    }
    let m = members[p.member];
    let r = rates[p.member];
    var sum = -r.start * pull_rate(m, p.member, p.item);
    if with_rate(WITH_RESTS) {
        sum += by_shape(m, p.member, p.item, rate_rests[at_node(p.member, p.item)].xyz, false);
    }
    let numbers = aging_numbers(p.member) + shape.aging_rows;
    let poses = pose_rows();
    let matrices = layer_rows();
    for (var row = 0u; row < poses; row++) {
        sum += rate_numbers[numbers + row] * by_pose(m, p.member, p.item, row);
    }
    if (shape.fields & FIELD_GRIPS) != 0u {
        let by = by_layer(m, p.member, p.item);
        for (var row = 0u; row < matrices; row++) {
            sum += (rate_numbers[numbers + poses + row] * layers[(1u + row) * shape.members + p.member]) * by.thickness;
        }
        var firmer = r.young / m.young + firm_by_poisson(m) * r.poisson;
        for (var row = 0u; row < shape.aging_rows; row++) {
            firmer += rate_numbers[aging_numbers(p.member) + row] * aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
        }
        sum += firmer * by.firm;
    }
    column[at_node(p.member, p.item)] += vec4(sum, 0.0);
}
