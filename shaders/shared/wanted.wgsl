//! Where clamps want the nodes that they hold.
// use shared/held

var<storage, read> rest: array<vec4<f32>>;
// As in shared/holds.
var<storage, read> poses: array<ClampPose>;

fn pose_now(member: u32, by: u32) -> ClampPose {
    let instant = select(0u, call.step + 1u, call.mode != 0u);
    return poses[(member * (shape.steps + 1u) + instant) * shape.clamps + by];
}

// Displacement at which the springs of a node balance [m].
fn wanted_at(member: u32, node: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let pose = pose_now(member, holders[k].by);
        sum += (holders[k].stiffness / spring_of(node)) * (pose.excess * rest[node].xyz + pose.shift.xyz);
    }
    return sum;
}

// Derivative of the springs' pull by time [N/s].
fn pull_rate(member: u32, node: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let pose = pose_now(member, holders[k].by);
        sum += holders[k].stiffness * (pose.turn_rate * rest[node].xyz + pose.shift_rate.xyz);
    }
    return sum;
}
