//! Derivative of the cells' force by the old state, times the vector `probe` (call.extra 0), or its transpose (1); with what the
//! clamps' pass and the effects' left for the old state. Twin of `by_old` and `by_old_transposed` of the CPU backend.
// use shared/cells

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read> old_stress: array<vec4<f32>>;
var<storage, read> patches: array<Patch>;
var<storage, read> touches: array<vec4<f32>>;
var<storage, read> hold_forces: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn couple_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    let u0 = (now[a].xyz - now[o].xyz) + (now[part(1u) + a].xyz - now[part(1u) + o].xyz);
    let u1 = (next[a].xyz - next[o].xyz) + (next[part(1u) + a].xyz - next[part(1u) + o].xyz);
    // Taken from corner 0 as well: rigid translation of the probe costs no digits.
    let d = probe[a].xyz - probe[o].xyz;
    let matrix = matrix_at(m.slot, 0u, cell.kind);
    let at = (p.member * shape.cells + e) * 8u + corner;
    let before = old_stress[at].xyz;
    let turning = free_pose(u0, sign);
    var f = vec3(0.0);
    if is_lagged() {
        let fresh = held_pose(turning.turn, u1, sign);
        let old = held_pose(turning.turn, u0, sign);
        let arms = mix.on_new * fresh.z + mix.on_old * old.z;
        let y = (mix.on_new * young) * stiff(matrix, corner, fresh.q) + mix.on_old * before;
        if call.extra == 0u {
            let omega = spin_body(turning, centred(transpose(turning.r) * d), sign);
            let dq = mix.on_old * strain_rate(old, d, sign) - cross(omega, arms);
            f = force(fresh, young * stiff(matrix, corner, dq) + cross(omega, y), sign);
        } else {
            let s = strain_rate(fresh, d, sign);
            let t = young * stiff(matrix, corner, s);
            let g = sum8(cross(y, s) - cross(arms, t));
            f = force(old, mix.on_old * t, sign) + turning.r * spin_adjoint_body(turning, g, sign);
        }
    } else {
        let fresh = free_pose(u1, sign);
        if call.extra == 0u {
            f = force(fresh, (mix.on_old * young) * stiff(matrix, corner, strain_rate(turning, d, sign)), sign);
        } else {
            f = force(turning, (mix.on_old * young) * stiff(matrix, corner, strain_rate(fresh, d, sign)), sign);
        }
        // The old state's own force, whose derivative is symmetric.
        let body = centred(transpose(turning.r) * d);
        let dq = body - cross(spin_body(turning, body, sign), turning.z);
        let own = force_body(turning, centred(young * stiff(matrix, corner, dq)), sign)
            + second_body(turning, centred(before), body, sign);
        f += turning.r * (mix.old * own);
    }
    for (var k = cell.hold_start; k < cell.hold_end; k++) {
        f += hold_forces[(p.member * shape.holds + k) * 8u + corner].xyz;
    }
    // Effects on patches leave their share where contact has its force.
    if (shape.fields & 4u) != 0u {
        for (var k = cell.patch_start; k < cell.patch_end; k++) {
            f -= patches[k].weights[corner] * touches[3u * (p.member * shape.patches + k)].xyz;
        }
    }
    if p.live {
        cell_force[at] = vec4(f, 0.0);
    }
}
