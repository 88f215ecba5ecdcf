//! What products by many workgroups leave: rows of A times a vector, a slice of a group of nodes a workgroup, with eight lanes a node; and what
//! the rows of the slice come to.
// use shared/precondition
// use shared/coarse
// use shared/keep_pair

// Where the nodes of each slice start among those of the groups.
var<body> slice_starts: array<u32>;

// The node of an invocation.
fn node_of_slice(share: Share, local: u32) -> Place {
    let k = slice_starts[share.first] + local / 8u;
    let live = k < slice_starts[share.first + 1u];
    return Place(share.member, share.home, group_nodes[min(k, shape.nodes - 1u)], share.runs, live);
}

// Adds what the eight lanes of a row have of it to what the first one has in `own`, and keeps the row and the sums of the slice.
fn keep_product(local: u32, share: Share, p: Place, own: vec3<f32>, parts: vec3<f32>) {
    shares[local] = vec4(parts, 0.0);
    workgroupBarrier();
    var force = vec4(0.0);
    var torque = vec4(0.0);
    if p.live && local % 8u == 0u {
        var row = own;
        for (var i = 0u; i < 8u; i++) {
            row += shares[local + i].xyz;
        }
        let a = at_node(p.member, p.item);
        let x = operand_at(a);
        solving[solving_part(IMAGE) + a] = vec4(row, 0.0);
        if (call.extra & OF_SOLUTION) == 0u {
            solving[way_at + a] = vec4(x, 0.0);
        }
        let arm = arms[p.item];
        let w = wrench_of(turn_of_group(p.home, group_of(arm)), arm, row);
        force = vec4(w.force, dot(x, row));
        torque = vec4(w.torque, 0.0);
    }
    keep_pair(local, slices_at(share.member) + OF_SLICE * share.first, force, torque);
}
