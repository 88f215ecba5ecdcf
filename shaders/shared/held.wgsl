//! Nodes that clamps hold, of bodies without cells. Twin of palpate-cpu/src/terms/held_nodes.rs but for one thing: their springs are so stiff
//! that single precision cannot tell the way that they give, so that a solve puts such a node where its clamp wants it and asks for no
//! balance there. In the matrix the springs stand as they are.

struct Holder { // mirrored
    // The clamp.
    by: u32,
    // Stiffness of its spring [N/m].
    stiffness: f32,
}

// Holders of each node.
var<storage, read> held_rows: array<u32>;
var<storage, read> holders: array<Holder>;

fn is_held(node: u32) -> bool {
    return held_rows[node] != held_rows[node + 1u];
}

// Stiffness of all springs of a node.
fn spring_of(node: u32) -> f32 {
    var sum = 0.0;
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        sum += holders[k].stiffness;
    }
    return sum;
}
