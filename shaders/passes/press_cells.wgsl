//! Elastic and viscous force of every cell on its corners at the new state, with the guard against inversion; and what clamps and
//! planes do to them.
// use shared/corner
// use shared/guard
// use shared/supports

var<storage, read> next: array<vec4<f32>>;
var<storage, read> old_stress: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let d = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
    var pose = pose_of(d, c.sign);
    pose.q = from_rest(pose.q, c.at);
    // Nothing is left of an old state in a static problem.
    var before = vec3(0.0);
    if call.mode != 0u {
        before = c.mix.on_old * old_stress[c.at].xyz;
    }
    let y = (c.mix.on_new * c.young) * stiff(matrix_at(c.m.slot, 0u, cells[c.cell].kind), c.number, pose.q) + before;
    var f = vec4(force(pose, y, c.sign), 0.5 * dot(pose.q, y + before));
    if is_guarded(pose.s) {
        let g = guard_force(pose.s, c.sign, guard_unit(c.mix.fresh * c.young, cells[c.cell]));
        f += vec4(pose.r * g.xyz, g.w);
    }
    let support = support_of(cells[c.cell], c.member, c.number);
    if c.live {
        cell_force[c.at] = f;
        cell_force[support_part() + c.at] = support;
    }
}
