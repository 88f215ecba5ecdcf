//! q = A p with the assembled matrix, eight lanes a row so that neighbouring lanes read neighbouring blocks; and parts of pᵀ q.
// use shared/mix
// use shared/totals
// use shared/iteration
// use shared/product

var<storage, read> block_rows: array<u32>;
var<storage, read> columns: array<u32>;
var<storage, read> values: array<f32>;
var<storage, read> cg_along: array<vec4<f32>>;
var<storage, read_write> cg_image: array<vec4<f32>>;

@compute @workgroup_size(256)
fn multiply_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local / 8u, shape.nodes, NARROW);
    if !p.runs || cg_scalars[4u * p.member + parity()].z != 0.0 {
        return;
    }
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var q = vec3(0.0);
    if p.live {
        let end = block_rows[p.item + 1u];
        for (var k = block_rows[p.item] + local % 8u; k < end; k += 8u) {
            let x = cg_along[at_node(p.member, columns[k])].xyz;
            let v = (p.home * shape.blocks + k) * 9u;
            q += vec3(
                values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
                values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
                values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
            );
            if has_mass_matrix() {
                q += (inertia * block_mass(m, p.home, k)) * x;
            }
        }
    }
    shares[local] = vec4(q, 0.0);
    workgroupBarrier();
    var curvature = vec4(0.0);
    if p.live && local % 8u == 0u {
        q = heavy_row(m, inertia, p);
        for (var i = 0u; i < 8u; i++) {
            q += shares[local + i].xyz;
        }
        let a = at_node(p.member, p.item);
        cg_image[a] = vec4(q, 0.0);
        curvature.x = dot(cg_along[a].xyz, q);
    }
    let bend = total(local, curvature).x;
    if local == 0u {
        cg_parts[parts_at(p.member, 0u) + p.item / NARROW] = bend;
    }
}
