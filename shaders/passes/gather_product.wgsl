//! q = A p at every node from what multiply_cells left on the corners, with mass damping, ghost penalty, inertia; parts of pᵀ q.
// use shared/mix
// use shared/team_256
// use shared/totals
// use shared/iteration
// use shared/product

var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
var<storage, read> cell_force: array<vec4<f32>>;
var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn gather_product(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, WIDE);
    if !share.runs {
        return;
    }
    let s = scalars_of(local, scalars_at(share.member) + parity());
    if s.z != 0.0 {
        return;
    }
    let before = scalars_of(local, scalars_at(share.member) + 1u - parity());
    set_way(parity(), way_factor_of(s, before));
    let p = place_in(share, local, shape.nodes);
    let m = members[p.member];
    let mix = mix_of(m);
    var curvature = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        var q = heavy_row(m, mix.inertia, p) + (mix.drag * node_mass(m, p.member, p.item)) * along_way(a);
        for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
            q += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        }
        if shape.ghosts != 0u {
            let scale = m.young * m.ghost.x * mix.on_ghost;
            for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
                q += (scale * ghosts[k]) * along_way(at_node(p.member, columns[k]));
            }
        }
        let way = along_way(a);
        solving[way_now() + a] = vec4(way, 0.0);
        solving[solving_part(IMAGE) + a] = vec4(q, 0.0);
        curvature.x = dot(way, q);
    }
    let bend = total(local, curvature).x;
    if local == 0u {
        cg_sums[bends_at(p.member) + share.first / WIDE] = vec4(bend, 0.0, 0.0, 0.0);
    }
}
