//! What a cell's tangent H_ij = R (s K_ij + Ω_i D_jᵀ + D_i Ω_jᵀ) Rᵀ is made of, beside K: R, G⁻¹ and R D_i per corner
//! (corotation.rs: D = B + ½QΩ − s(N − ½TΩ); without B and Q where the convex part is wanted); and the guard against inversion, as
//! shared/tangents.wgsl says. 30 vectors per cell: no 24 × 24 matrix is ever stored.
// use shared/rank_six
// use shared/guard
// use shared/unstrained

var<storage, read> next: array<vec4<f32>>;
var<storage, read> old_stress: array<vec4<f32>>;
var<storage, read> newton: array<Newton>;
var<storage, read_write> tangents: array<vec4<f32>>;

@compute @workgroup_size(64)
fn tangent_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    let scale = mix.on_new * young;
    let matrix = matrix_at(m.slot, 0u, cell.kind);
    var pose = pose_of(d, sign);
    pose.q = from_rest(pose.q, (p.member * shape.cells + e) * 8u + corner);
    var before = vec3(0.0);
    if call.mode != 0u {
        before = mix.on_old * old_stress[(p.member * shape.cells + e) * 8u + corner].xyz;
    }
    let y = centred(scale * stiff(matrix, corner, pose.q) + before);
    let convex = newton[p.member].convex != 0u;
    let turned = pose.r * rank_six(pose, matrix, corner, sign, scale, y, convex);
    if p.live {
        let at = (p.member * shape.cells + e) * TANGENT_VECTORS;
        for (var c = 0u; c < 3u; c++) {
            tangents[at + 6u + 3u * corner + c] = vec4(turned[c], 0.0);
        }
        if corner == 0u {
            for (var c = 0u; c < 3u; c++) {
                tangents[at + c] = vec4(pose.r[c], 0.0);
                tangents[at + 3u + c] = vec4(pose.g[c], 0.0);
            }
            if is_guarded(pose.s) {
                let guard = guard_at(pose.s);
                let unit = guard_unit(mix.fresh * young, cell);
                let s = pose.s;
                tangents[at].w = unit * guard.bend;
                tangents[at + 1u].w = select(unit * guard.slope, 0.0, convex);
                tangents[at + 2u].w = s[0].x;
                tangents[at + 3u].w = s[0].y;
                tangents[at + 4u].w = s[0].z;
                tangents[at + 5u].w = s[1].y;
                tangents[at + 6u].w = s[1].z;
                tangents[at + 7u].w = s[2].z;
            }
        }
    }
}
