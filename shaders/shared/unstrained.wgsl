//! The stress-free shape where effects change it; without such effects nothing here is read.
// use shared/grid

// [B][N]: displacement W of that shape.
var<storage, read> rests: array<vec4<f32>>;
// [B][cells · 8]: deformation of every cell in that shape.
var<storage, read> rest_shapes: array<vec4<f32>>;

fn has_rest() -> bool {
    return (shape.fields & FIELD_REST) != 0u;
}

// True when a body that starts at rest starts in the shape X + W.
fn starts_unstrained() -> bool {
    return (shape.fields & FIELD_STARTS) != 0u;
}

// A corner's deformation, measured from the stress-free shape; `at` is its place in what is kept per corner.
fn from_rest(q: vec3<f32>, at: u32) -> vec3<f32> {
    if has_rest() {
        return q - rest_shapes[at].xyz;
    }
    return q;
}
