//! How what clamps do to a node changes with the numbers of effects on them, with the stiffness of the layers, and with the time of the start.
// use shared/wanted
// use shared/pulls

// As in push_holds.
var<batch> hold_slopes: array<HoldSlope>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> reactions: array<vec4<f32>>;

// Numbers of effects that move poses, and of those that change layers.
fn pose_rows() -> u32 {
    return extractBits(call.extra, POSES_AT, MATRICES_AT - POSES_AT);
}

fn layer_rows() -> u32 {
    return call.extra >> MATRICES_AT;
}

// Change of the force on a node with the number of a row, as the pose has it.
fn by_pose(m: Member, member: u32, node: u32, row: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let at = ((row * shape.members + member) * (shape.steps + 1u) + instant_now()) * shape.clamps + holders[k].by;
        let slope = hold_slopes[at];
        let spring = spring_at(firm_of(m, member), layer_of(member), holders[k]);
        sum -= spring.stiffness * (slope.turn * (rest[node].xyz + unloaded(member, node)) + slope.shift.xyz);
    }
    return sum;
}

// Change of the force on a node when the stress-free shape moves it by `v`, or the transposed product.
fn by_shape(m: Member, member: u32, node: u32, v: vec3<f32>, transposed: bool) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let turn = pose_now(member, holders[k].by).turn;
        let moved = select(turn * v, transpose(turn) * v, transposed);
        sum -= spring_at(firm_of(m, member), layer_of(member), holders[k]).stiffness * moved;
    }
    return sum;
}

// Changes of the force on a node with the thickness of the layers, and with the logarithm of their stiffness.
struct ByLayer {
    thickness: vec3<f32>,
    firm: vec3<f32>,
}

fn by_layer(m: Member, member: u32, node: u32) -> ByLayer {
    var sum: ByLayer;
    let a = at_node(member, node);
    let layer = layer_of(member);
    let firm = firm_of(m, member);
    var whole = 0.0;
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        whole += spring_at(firm, layer, holders[k]).stiffness;
    }
    for (var k = held_rows[node]; k < held_rows[node + 1u]; k++) {
        let spring = spring_at(firm, layer, holders[k]);
        // The way of the springs, or where the node is in place, what they bear over what they are.
        var away = reactions[a].xyz / whole;
        if gives_way(member) {
            away = (next[a].xyz - wanted_by(member, holders[k].by, node)) + next[part(1u) + a].xyz;
        }
        sum.thickness += spring.by_layer * away;
        sum.firm += spring.by_firm * away;
    }
    return sum;
}
