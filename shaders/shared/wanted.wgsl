//! Where clamps want the nodes that they hold.
// use shared/springs
// use shared/unstrained

var<body> rest: array<vec4<f32>>;
// As in shared/holds.
var<batch> poses: array<ClampPose>;

fn instant_now() -> u32 {
    return select(0u, call.step + 1u, call.mode != 0u);
}

fn pose_now(member: u32, by: u32) -> ClampPose {
    return poses[(member * (shape.steps + 1u) + instant_now()) * shape.clamps + by];
}

// Displacement at which the springs of a node balance [m].
fn wanted_at(member: u32, node: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        sum += (holders[k].stiffness / spring_of(node)) * wanted_by(member, holders[k].by, node);
    }
    return sum;
}

// Displacement of a node in the stress-free shape, which is what clamps hold [m].
fn unloaded(member: u32, node: u32) -> vec3<f32> {
    if !has_rest() {
        return vec3(0.0);
    }
    return rests[at_node(member, node)].xyz;
}

// Where clamp `by` wants a node [m].
fn wanted_by(member: u32, by: u32, node: u32) -> vec3<f32> {
    let pose = pose_now(member, by);
    return pose.excess * rest[node].xyz + pose.shift.xyz + pose.turn * unloaded(member, node);
}

// Derivative of the springs' pull by time [N/s].
fn pull_rate(m: Member, member: u32, node: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let pose = pose_now(member, holders[k].by);
        let spring = spring_at(firm_of(m, member), layer_of(member), holders[k]);
        sum += spring.stiffness * (pose.turn_rate * (rest[node].xyz + unloaded(member, node)) + pose.shift_rate.xyz);
    }
    return sum;
}
