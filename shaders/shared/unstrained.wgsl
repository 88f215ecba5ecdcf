//! The stress-free shape where effects change it; without such effects nothing here is read.
// use shared/grid

// [B][N]: displacement W of that shape.
var<batch> rests: array<vec4<f32>>;
// [B][cells · 8]: deformation of every cell in that shape. Of a body of elastic points [B][points · 3]: columns of I − G⁻¹ with G = I + ∇W, the
// first with det G.
var<batch> rest_shapes: array<vec4<f32>>;

fn has_rest() -> bool {
    return (shape.fields & FIELD_REST) != 0u;
}

// True when a body that starts at rest starts in the shape X + W.
fn starts_unstrained() -> bool {
    return (shape.fields & FIELD_STARTS) != 0u;
}

// I − G⁻¹ of an elastic point; points are counted through the members.
fn shift_of(point: u32) -> mat3x3<f32> {
    if !has_rest() {
        return mat3x3<f32>();
    }
    let at = 3u * point;
    return mat3x3(rest_shapes[at].xyz, rest_shapes[at + 1u].xyz, rest_shapes[at + 2u].xyz);
}

// The gradient of a field by places of the stress-free shape, from that by places of the given one.
fn by_unstrained(point: u32, h: mat3x3<f32>) -> mat3x3<f32> {
    if !has_rest() {
        return h;
    }
    return h - h * shift_of(point);
}

// Weight of a gradient likewise: G⁻ᵀ g.
fn weight_unstrained(point: u32, g: vec3<f32>) -> vec3<f32> {
    if !has_rest() {
        return g;
    }
    return g - g * shift_of(point);
}

// How much volume the stress-free shape has for one of the given one.
fn swelling(point: u32) -> f32 {
    if !has_rest() {
        return 1.0;
    }
    return rest_shapes[3u * point].w;
}

// A corner's deformation, measured from the stress-free shape; `at` is its place in what is kept per corner.
fn from_rest(q: vec3<f32>, at: u32) -> vec3<f32> {
    if has_rest() {
        return q - rest_shapes[at].xyz;
    }
    return q;
}
