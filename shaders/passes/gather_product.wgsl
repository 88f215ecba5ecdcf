//! A p at every node from what multiply_cells left on the corners, with mass damping, ghost penalty, inertia, eight lanes a node. call.extra: ODD;
//! or OF_SOLUTION, for A x.
// use shared/parity_called
// use shared/mix
// use shared/team_256
// use shared/totals
// use shared/operand
// use shared/product
// use shared/slices

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
    let share = find_share(group, groups, shape.slices, 1u);
    if !share.runs {
        return;
    }
    if !goes_on(local, share) {
        return;
    }
    let p = node_of_slice(share, local);
    let m = members[p.home];
    let mix = mix_of(m);
    let lane = local % 8u;
    var own = vec3(0.0);
    var q = vec3(0.0);
    if p.live {
        if lane == 0u {
            let x = operand_at(at_node(p.member, p.item));
            own = heavy_row(m, mix.inertia, p) + (mix.drag * node_mass(m, p.member, p.item)) * x;
        }
        for (var k = node_rows[p.item] + lane; k < node_rows[p.item + 1u]; k += 8u) {
            q += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        }
        if shape.ghosts != 0u {
            let scale = m.young * m.ghost.x * mix.on_ghost;
            for (var k = block_rows[p.item] + lane; k < block_rows[p.item + 1u]; k += 8u) {
                q += (scale * ghosts[k]) * operand_at(at_node(p.member, columns[k]));
            }
        }
    }
    keep_product(local, share, p, own, q);
}
