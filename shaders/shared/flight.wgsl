//! The increment of a state beyond free flight, which trials of a solve are: counted without the digits of a long way.
// use shared/mix

var<storage, read> now: array<vec4<f32>>;

// Of the displacement `whole` + `rest` of a node, `a` its place in all members; in a static problem all of it.
fn beyond_flight(member: u32, a: u32, whole: vec3<f32>, rest: vec3<f32>) -> vec3<f32> {
    if call.mode == 0u {
        return whole + rest;
    }
    let flight = shape.dt * now[part(2u) + a].xyz + shape.theta * shape.dt * shape.dt * members[member].gravity.xyz;
    return (whole - now[a].xyz) + (rest - now[part(1u) + a].xyz) - flight;
}
