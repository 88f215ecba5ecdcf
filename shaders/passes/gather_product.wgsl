//! q = A p at every node from what multiply_cells left on the corners, with mass damping, ghost penalty, inertia; parts of pᵀ q.
// use shared/mix
// use shared/totals
// use shared/iteration
// use shared/product

var<storage, read> node_rows: array<u32>;
var<storage, read> node_list: array<u32>;
var<storage, read> block_rows: array<u32>;
var<storage, read> columns: array<u32>;
var<storage, read> ghosts: array<f32>;
var<storage, read> cell_force: array<vec4<f32>>;
var<storage, read> cg_along: array<vec4<f32>>;
var<storage, read_write> cg_image: array<vec4<f32>>;

@compute @workgroup_size(256)
fn gather_product(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, WIDE);
    if !p.runs || cg_scalars[4u * p.member + parity()].z != 0.0 {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    var curvature = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        var q = heavy_row(m, mix.inertia, p) + (mix.drag * node_mass(m, p.member, p.item)) * cg_along[a].xyz;
        for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
            q += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        }
        if shape.ghosts != 0u {
            let scale = m.young * m.ghost.x * mix.on_ghost;
            for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
                q += (scale * ghosts[k]) * cg_along[at_node(p.member, columns[k])].xyz;
            }
        }
        cg_image[a] = vec4(q, 0.0);
        curvature.x = dot(cg_along[a].xyz, q);
    }
    let bend = total(local, curvature).x;
    if local == 0u {
        cg_parts[parts_at(p.member, 0u) + p.item / WIDE] = bend;
    }
}
