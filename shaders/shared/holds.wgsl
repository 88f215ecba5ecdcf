//! Clamp cells: how far their corners are from where the clamp wants them, and the force and product of Nitsche's matrix.
// use shared/lanes
// use shared/mix
// use shared/fields
// use shared/unstrained

var<body> cells: array<Cell>;
// (cell, clamp) of each clamp cell, ordered by cell.
var<body> holds: array<vec2<u32>>;
// As `grip_at` says.
var<matrices> hold_elements: array<f32>;
// [B][steps + 1][clamps]: poses at the start and at the end of every step.
var<batch> poses: array<ClampPose>;
var<body> rest: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;

fn pose_at(member: u32, instant: u32, clamp_number: u32) -> ClampPose {
    return poses[(member * (shape.steps + 1u) + instant) * shape.clamps + clamp_number];
}

// This corner's three rows of the matrix that starts there, times v.
fn hold_stiff(matrix: u32, corner: u32, v: vec3<f32>) -> vec3<f32> {
    publish(v);
    let start = matrix + 3u * corner;
    var sum = vec3(0.0);
    for (var j = 0u; j < 8u; j++) {
        let a = start + 72u * j;
        let w = published(j);
        sum += w.x * vec3(hold_elements[a], hold_elements[a + 1u], hold_elements[a + 2u])
            + w.y * vec3(hold_elements[a + 24u], hold_elements[a + 25u], hold_elements[a + 26u])
            + w.z * vec3(hold_elements[a + 48u], hold_elements[a + 49u], hold_elements[a + 50u]);
    }
    return sum;
}

// Aᵀ(x − b) − X without cancellation.
fn deviation(pose: ClampPose, u: vec3<f32>, x: vec3<f32>) -> vec3<f32> {
    return transpose(pose.turn) * (u - pose.shift.xyz) + transpose(pose.excess) * x;
}

// A clamp cell's corner at one instant of a step.
struct Held {
    // Weight in the residual, and number of the instant.
    weight: f32,
    at: u32,
    pose: ClampPose,
    // Displacement, and what it differs by from that which the clamp wants, in the clamp's frame.
    u: vec3<f32>,
    deviation: vec3<f32>,
}

// Instant 0 is the new state, 1 the old one; `a` is the corner's node in all members.
fn held_at(member: u32, clamp_number: u32, a: u32, x: vec3<f32>, mix: Mix, instant: u32) -> Held {
    var h: Held;
    h.weight = select(mix.fresh, mix.old, instant == 1u);
    if call.mode != 0u {
        h.at = call.step + 1u - instant;
    }
    h.pose = pose_at(member, h.at, clamp_number);
    h.u = next[a].xyz + next[part(1u) + a].xyz;
    if instant == 1u {
        h.u = now[a].xyz + now[part(1u) + a].xyz;
    }
    h.deviation = deviation(h.pose, h.u, x);
    if has_rest() {
        h.deviation -= rests[a].xyz;
    }
    return h;
}
