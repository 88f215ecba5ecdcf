//! What the old state leaves for the whole solve of a step: E K q₀ per corner, and its own constant force.
// use shared/past

var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> old_stress: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;
var<storage, read> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    var pose = pose_of((now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz), c.sign);
    pose.q = past_q(c, pose.q);
    let y = c.young * stiff(matrix_at(c.m.slot, 0u, cells[c.cell].kind), c.number, pose.q);
    var f = force(pose, c.mix.old * y, c.sign);
    for (var k = cells[c.cell].hold_start; k < cells[c.cell].hold_end; k++) {
        f += supports[hold_part() + (c.member * shape.holds + k) * 8u + c.number].xyz;
    }
    if c.live {
        old_stress[c.at] = vec4(y, 0.0);
        cell_force[c.at] = vec4(f, 0.0);
    }
}
