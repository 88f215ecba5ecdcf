//! Derivatives by the stress-free shape at every node: through the corners of its cells, their clamps, and the ghost penalty.
// use shared/mix
// use shared/pulls

var<storage, read> probe: array<vec4<f32>>;
var<body> cells: array<Cell>;
var<storage, read> cell_force: array<vec4<f32>>;
var<storage, read> supports: array<vec4<f32>>;
var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
// [B][N]
var<storage, read_write> rest_pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_rest(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    var f = vec3(0.0);
    for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
        f += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        let cell = cells[node_list[k] / 8u];
        for (var h = cell.hold_start; h < cell.hold_end; h++) {
            f += supports[hold_part() + (p.member * shape.holds + h) * 8u + node_list[k] % 8u].xyz;
        }
    }
    if shape.ghosts != 0u {
        let scale = m.young * m.ghost.x * (mix.fresh + mix.old);
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            f -= (scale * ghosts[k]) * (probe[at_node(p.member, columns[k])].xyz - probe[a].xyz);
        }
    }
    rest_pulls[a] -= vec4(f, 0.0);
}
