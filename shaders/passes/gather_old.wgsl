//! Sums the old state's constant forces per node: cells and clamps, and the ghost penalty's share.
// use shared/mix

var<storage, read> now: array<vec4<f32>>;
var<storage, read> cell_force: array<vec4<f32>>;
var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
var<storage, read_write> old_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn gather_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    }
    if shape.ghosts != 0u {
        let scale = m.young * m.ghost.x * (mix.old - mix.rate);
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            let b = at_node(p.member, columns[k]);
            f += (scale * ghosts[k]) * ((now[b].xyz - now[a].xyz) + (now[part(1u) + b].xyz - now[part(1u) + a].xyz));
        }
    }
    old_force[a] = vec4(f, 0.0);
}
