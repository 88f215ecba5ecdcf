//! Adds the springs of nodes that are held to the diagonal of the matrix of a body without cells.
// use shared/springs

var<body> diagonals: array<u32>;
var<storage, read_write> values: array<f32>;

@compute @workgroup_size(64)
fn brace_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let firm = firm_of(members[p.member], p.member);
    var added = 0.0;
    for (var k = held_rows[p.item]; k < held_rows[p.item + 1u]; k++) {
        added += spring_at(firm, layer_of(p.member), holders[k]).stiffness;
    }
    let at = (p.member * shape.blocks + diagonals[p.item]) * 9u;
    for (var axis = 0u; axis < 3u; axis++) {
        values[at + 4u * axis] += added;
    }
}
