//! Elastic and viscous force of every cell on its corners at the new state, and what clamps and planes do to them.
// use shared/cells
// use shared/supports

var<storage, read> next: array<vec4<f32>>;
var<storage, read> old_turn: array<vec4<f32>>;
var<storage, read> old_stress: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;
var<storage, read_write> cell_support: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    lanes_start(local);
    let p = find_place(group, groups, local / 8u, shape.cells, 8u);
    let e = min(p.item, shape.cells - 1u);
    let corner = local % 8u;
    let sign = sign_of(corner);
    let cell = cells[e];
    let m = members[p.member];
    let mix = mix_of(m);
    let young = young_at(m, p.member, e);
    let a = at_node(p.member, cell.nodes[corner]);
    let o = at_node(p.member, cell.nodes[0]);
    let d = (next[a].xyz - next[o].xyz) + (next[part(1u) + a].xyz - next[part(1u) + o].xyz);
    let at = (p.member * shape.cells + e) * 8u + corner;
    var pose: Pose;
    if is_lagged() {
        pose = held_pose(old_turn[p.member * shape.cells + e], d, sign);
    } else {
        pose = free_pose(d, sign);
    }
    // Nothing is left of an old state in a static problem.
    var before = vec3(0.0);
    if call.mode != 0u {
        before = mix.on_old * old_stress[at].xyz;
    }
    let y = (mix.on_new * young) * stiff(matrix_at(m.slot, 0u, cell.kind), corner, pose.q) + before;
    let f = force(pose, y, sign);
    let energy = 0.5 * dot(pose.q, y + before);
    let support = support_of(cell, p.member, corner);
    if p.live {
        cell_force[at] = vec4(f, energy);
        cell_support[at] = support;
    }
}
