//! Deformation of a stage's past. From several states what damps sees the weighted sum of their deformations, not the deformation of their
//! weighted sum, in which a rotation would look like strain.
// use shared/corner

// [B][cells · 8]: the weighted sum, of stages that start from several states.
var<storage, read> old_q: array<vec4<f32>>;

// That of the old state where there is one alone, whose body-frame deformation is q.
fn past_q(c: Corner, q: vec3<f32>) -> vec3<f32> {
    if (shape.fields & FIELD_SEVERAL) != 0u {
        return old_q[c.at].xyz;
    }
    return from_rest(q, c.at);
}
