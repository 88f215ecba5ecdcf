//! Second level of the preconditioner: groups of nodes that move as rigid bodies. M⁻¹ = D⁻¹ + Q C Qᵀ with the nodes' own blocks D, the rigid
//! motions Q of the groups, and C ≈ (Qᵀ A Q)⁻¹, which the host made for the body at rest (world/coarse.rs). Groups turn, and what the host
//! knows turns with them: forces are told in the frame of their group, where arms stay what they are at rest.

// Nodes of each group.
var<body> group_rows: array<u32>;
var<body> group_nodes: array<u32>;
// Arm of each node from its group's centre at rest, over the size of groups; and the group's number. That is below zero, counted from -1 on, at a node
// that springs hold: it does not move with its group, Q has no rows there.
var<body> arms: array<vec4<f32>>;

fn group_of(arm: vec4<f32>) -> u32 {
    return u32(select(arm.w, -1.0 - arm.w, arm.w < 0.0));
}

fn turned(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}

fn turned_back(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    return v + 2.0 * cross(q.xyz, cross(q.xyz, v) - q.w * v);
}

// Force and torque of a group, or its shift and its turn.
struct Wrench {
    force: vec3<f32>,
    torque: vec3<f32>,
}

// What a force on a node is to its group.
fn wrench_of(turn: vec4<f32>, arm: vec4<f32>, force: vec3<f32>) -> Wrench {
    if arm.w < 0.0 {
        return Wrench(vec3(0.0), vec3(0.0));
    }
    let own = turned_back(turn, force);
    return Wrench(own, cross(arm.xyz, own));
}

// How a node moves with its group.
fn carried(turn: vec4<f32>, arm: vec4<f32>, motion: Wrench) -> vec3<f32> {
    if arm.w < 0.0 {
        return vec3(0.0);
    }
    return turned(turn, motion.force + cross(motion.torque, arm.xyz));
}

// The motion of a group that forces on one of them make, summed over calls.
struct Motion {
    // Shift, and the first number of the turn.
    upper: vec4<f32>,
    // Its other two.
    lower: vec4<f32>,
}
