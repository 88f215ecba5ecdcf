//! First of an iteration where A p is made without a matrix: has the solve converged? If not, every cell applies R (s K + …) Rᵀ of its class
//! (see tangent_cells), its clamps and its patches to its corners, for gather_product.
// use shared/parity_called
// use shared/cells
// use shared/tangents
// use shared/patches
// use shared/team_64
// use shared/totals
// use shared/turn

var<storage, read> supports: array<vec4<f32>>;
var<body> holds: array<vec2<u32>>;
var<matrices> hold_elements: array<f32>;
var<batch> poses: array<ClampPose>;
var<storage, read> solving: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

fn hold_block(start: u32, i: u32, j: u32) -> mat3x3<f32> {
    let a = start + 72u * j + 3u * i;
    return mat3x3(
        vec3(hold_elements[a], hold_elements[a + 1u], hold_elements[a + 2u]),
        vec3(hold_elements[a + 24u], hold_elements[a + 25u], hold_elements[a + 26u]),
        vec3(hold_elements[a + 48u], hold_elements[a + 49u], hold_elements[a + 50u]),
    );
}

@compute @workgroup_size(64)
fn multiply_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    lanes_start(local);
    let share = find_share(group, groups, shape.cells, 8u);
    if !share.runs {
        return;
    }
    if !multiplies(local, share) {
        return;
    }
    let p = place_in(share, local / 8u, shape.cells);
    let e = min(p.item, shape.cells - 1u);
    let corner = local % 8u;
    let cell = cells[e];
    let m = members[p.member];
    let mix = mix_of(m);
    let young = young_at(m, p.member, e);
    let at = (p.member * shape.cells + e) * TANGENT_VECTORS;
    let r = three(at);
    let d = three(at + 6u + 3u * corner);
    // R Ω_i = −R [b_i]× G⁻¹.
    let omega = r * (cross_matrix(sign_of(corner) * (-0.25 / shape.h)) * three(at + 3u));
    let x = operand_at(at_node(p.member, cell.nodes[corner]));
    var y = (mix.on_new * young) * (r * stiff(matrix_at(m.slot, 0u, cell.kind), corner, transpose(r) * x));
    let along_d = sum8(transpose(d) * x);
    let along_omega = sum8(transpose(omega) * x);
    y += omega * along_d + d * along_omega;
    if has_guard(at) {
        var a = mat3x3<f32>();
        for (var j = 0u; j < 8u; j++) {
            a += dyad(transpose(r) * operand_at(at_node(p.member, cell.nodes[j])), slope_of(sign_of(j)));
        }
        y += r * (guard_rate(at, a) * slope_of(sign_of(corner)));
    }
    for (var k = cell.hold_start; k < cell.hold_end; k++) {
        var instant = 0u;
        if call.mode != 0u {
            instant = call.step + 1u;
        }
        let turn = poses[(p.member * (shape.steps + 1u) + instant) * shape.clamps + holds[k].y].turn;
        var f = vec3(0.0);
        for (var j = 0u; j < 8u; j++) {
            f += hold_block(grip_at(m, p.member, 0u, k), corner, j)
                * (transpose(turn) * operand_at(at_node(p.member, cell.nodes[j])));
        }
        y += (mix.fresh * young) * (turn * f);
    }
    if shape.patches != 0u {
        for (var k = cell.patch_start; k < cell.patch_end; k++) {
            var there = vec3(0.0);
            for (var j = 0u; j < 8u; j++) {
                there += corner_weight(k, j) * operand_at(at_node(p.member, cell.nodes[j]));
            }
            let s = 3u * (p.member * shape.patches + k);
            let g = supports[s + 1u].xyz;
            let o = supports[s + 2u].xyz;
            y += corner_weight(k, corner) * (mat3x3(vec3(g.x, o.x, o.y), vec3(o.x, g.y, o.z), vec3(o.y, o.z, g.z)) * there);
        }
    }
    if p.live {
        cell_force[(p.member * shape.cells + e) * 8u + corner] = vec4(y, 0.0);
    }
}
