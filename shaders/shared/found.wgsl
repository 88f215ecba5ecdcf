//! What a look found: places of its points, and its scalar residuals, one a row.

struct Found { // mirrored
    xi: vec3<f32>,
    phi: f32,
    // World gradient of the deformed distance.
    gradient: vec3<f32>,
    // Band cell, or NONE.
    cell: u32,
}

// [slots][most points]
var<storage, read_write> found: array<Found>;
// [slots][most rows]: residual [m], and its Gauss–Newton weight w/(nσ²), below zero where a point met nothing.
var<storage, read_write> rows: array<vec2<f32>>;
