//! Conjugate gradients by many workgroups, first of an iteration: has it converged? If not, A p with the assembled matrix, eight lanes a row so
//! that neighbouring lanes read neighbouring blocks. call.extra: ODD; or OF_SOLUTION, for A x.
// use shared/team_256
// use shared/totals
// use shared/turn
// use shared/blocks
// use shared/slices

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn multiply_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.slices, 1u);
    if !share.runs {
        return;
    }
    if !multiplies(local, share) {
        return;
    }
    let p = node_of_slice(share, local);
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var own = vec3(0.0);
    var q = vec3(0.0);
    if p.live {
        if local % 8u == 0u {
            own = heavy_row(m, inertia, p);
        }
        let end = block_rows[p.item + 1u];
        for (var k = block_rows[p.item] + local % 8u; k < end; k += 8u) {
            q = with_block(q, m, p, inertia, k);
        }
    }
    keep_product(local, share, p, own, q);
}
