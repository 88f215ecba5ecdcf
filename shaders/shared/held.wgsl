//! Nodes that clamps hold, of bodies without cells. Twin of palpate-cpu/src/terms/held_nodes.rs but for one thing: their springs are so stiff
//! that single precision cannot tell the way that they give, so that a solve puts such a node where its clamp wants it and asks for no
//! balance there. In the matrix the springs stand as they are. Where effects put a layer that gives way between body and clamp, the springs are
//! soft enough, and the node is one like others (`shared/springs.wgsl`).

struct Holder { // mirrored
    // The clamp.
    by: u32,
    // Stiffness of its spring [N/m].
    stiffness: f32,
    // Held surface that the node stands for [m²].
    area: f32,
}

// Holders of each node.
var<body> held_rows: array<u32>;
var<body> holders: array<Holder>;
// [1 + rows][B]: thickness of the layer [m], and its derivatives by numbers of effects; only where effects act on clamps.
var<batch> layers: array<f32>;

fn layer_of(member: u32) -> f32 {
    if (shape.fields & FIELD_GRIPS) == 0u {
        return 0.0;
    }
    return layers[member];
}

// Layers thinner than this part of an element's edge give way by less than single precision tells.
const THIN = 1e-4;

fn gives_way(member: u32) -> bool {
    return layer_of(member) > THIN * shape.element_size;
}

// Whether a member puts a node in place.
fn is_held(member: u32, node: u32) -> bool {
    return held_rows[node] != held_rows[node + 1u] && !gives_way(member);
}

// Stiffness of all springs of a node, layers left out.
fn spring_of(node: u32) -> f32 {
    var sum = 0.0;
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        sum += holders[k].stiffness;
    }
    return sum;
}
