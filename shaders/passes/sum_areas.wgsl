//! What outliers weigh for each camera: their density against the area that it sees. One workgroup a camera.
// use shared/crowd
// use shared/reduce

// [C][K]
var<storage, read> weights: array<f32>;
// [C]
var<storage, read_write> floors: array<f32>;

@compute @workgroup_size(64)
fn sum_areas(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let camera = group.x;
    var sum = 0.0;
    for (var k = local; k < crowd.places; k += 64u) {
        sum += weights[camera * crowd.places + k];
    }
    let whole = tree(local, vec4(sum, 0.0, 0.0, 0.0)).x;
    if local == 0u {
        floors[camera] = whole * crowd.floor;
    }
}
