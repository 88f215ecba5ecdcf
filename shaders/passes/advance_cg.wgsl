//! Conjugate gradients by many workgroups, last of an iteration: x ← x + α p, r ← r − α q; and parts of rᵀ M⁻¹ r.
// use shared/grid
// use shared/totals
// use shared/precondition
// use shared/iteration

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn advance_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, WIDE);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    let s = scalars_of(local, scalars_at(share.member) + parity());
    if s.z != 0.0 {
        return;
    }
    let bend = sum_parts(local, share.member, 0u, product_width());
    let bad = !(bend > 0.0);
    if p.item == 0u {
        cg_sums[scalars_at(p.member) + 2u + parity()] = vec4(select(0.0, 1.0, bad), 0.0, 0.0, 0.0);
    }
    if bad {
        return;
    }
    let alpha = s.x / bend;
    var left = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        solving[a] += alpha * solving[solving_part(ALONG_WAY) + a];
        let rest = solving_part(REST) + a;
        let r = solving[rest].xyz - alpha * solving[solving_part(IMAGE) + a].xyz;
        solving[rest] = vec4(r, 0.0);
        left.x = dot(r, scaled(at_node(p.home, p.item), r));
    }
    let rz = total(local, left).x;
    if local == 0u {
        cg_sums[parts_at(p.member, 1u) + p.item / WIDE] = vec4(rz, 0.0, 0.0, 0.0);
    }
}
