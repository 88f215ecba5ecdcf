//! Conjugate gradients by many workgroups, last of an iteration: x ← x + α p, r ← r − α q; and parts of rᵀ M⁻¹ r.
// use shared/grid
// use shared/totals
// use shared/precondition
// use shared/iteration

var<storage, read> cg_along: array<vec4<f32>>;
var<storage, read> cg_image: array<vec4<f32>>;
var<storage, read_write> direction: array<vec4<f32>>;
var<storage, read_write> cg_rest: array<vec4<f32>>;

@compute @workgroup_size(256)
fn advance_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, WIDE);
    if !p.runs {
        return;
    }
    let s = cg_scalars[4u * p.member + parity()];
    if s.z != 0.0 {
        return;
    }
    let bend = sum_parts(local, p.member, 0u, product_width());
    let bad = !(bend > 0.0);
    if p.item == 0u {
        cg_scalars[4u * p.member + 2u + parity()] = vec4(select(0.0, 1.0, bad), 0.0, 0.0, 0.0);
    }
    if bad {
        return;
    }
    let alpha = s.x / bend;
    var left = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        direction[a] += alpha * cg_along[a];
        let r = cg_rest[a].xyz - alpha * cg_image[a].xyz;
        cg_rest[a] = vec4(r, 0.0);
        left.x = dot(r, scaled(at_node(p.home, p.item), r));
    }
    let rz = total(local, left).x;
    if local == 0u {
        cg_parts[parts_at(p.member, 1u) + p.item / WIDE] = rz;
    }
}
