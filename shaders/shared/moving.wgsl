//! Where rigid things are that a file moves: obstacles first, then nozzles.
// use shared/mix

// x ↦ turn x + shift and its rates. The shift holds a member's offset: of an obstacle to where it is, of a nozzle to its jet's virtual origin.
struct MovingPose { // mirrored
    turn: mat3x3<f32>,
    turn_rate: mat3x3<f32>,
    shift: vec4<f32>,
    shift_rate: vec4<f32>,
    // Across the axis of a nozzle, in the world: the axes of its picture.
    first: vec4<f32>,
    second: vec4<f32>,
}

// [B][1 + stages][2][things]: of obstacles in the new and in the old state, of nozzles at the time of the forces.
var<batch> moving_poses: array<MovingPose>;
// [B][numbers of all effects]
var<batch> effect_values: array<f32>;

fn moving_pose(member: u32, which: u32, thing: u32) -> MovingPose {
    var instant = 0u;
    if call.mode != 0u {
        instant = call.step + 1u;
    }
    let row = (member * (shape.steps + 1u) + instant) * 2u + which;
    return moving_poses[row * (shape.obstacles + shape.jets) + thing];
}
