//! What the old state leaves for the whole solve of a step: its rotation, E K q₀ per corner, and its own constant force.
// use shared/cells

var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> old_turn: array<vec4<f32>>;
var<storage, read_write> old_stress: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;
var<storage, read> hold_forces: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    let pose = free_pose((now[a].xyz - now[o].xyz) + (now[part(1u) + a].xyz - now[part(1u) + o].xyz), sign);
    let y = young * stiff(matrix_at(m.slot, 0u, cell.kind), corner, pose.q);
    // With lagged rotation the old force goes through the new pose, which has the same rotation.
    var f = force(pose, mix.old * y, sign);
    if is_lagged() {
        f = vec3(0.0);
    }
    for (var k = cell.hold_start; k < cell.hold_end; k++) {
        f += hold_forces[(p.member * shape.holds + k) * 8u + corner].xyz;
    }
    if p.live {
        let at = (p.member * shape.cells + e) * 8u + corner;
        old_stress[at] = vec4(y, 0.0);
        cell_force[at] = vec4(f, 0.0);
        if corner == 0u {
            old_turn[p.member * shape.cells + e] = pose.turn;
        }
    }
}
