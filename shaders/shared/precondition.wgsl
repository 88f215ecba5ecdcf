//! Block-Jacobi: the inverse of a node's own block, from invert_diagonal.

var<storage, read> inverses: array<vec4<f32>>;

// `a`: a node of the member whose matrix it is.
fn scaled(a: u32, r: vec3<f32>) -> vec3<f32> {
    let s = inverses[2u * a];
    let t = inverses[2u * a + 1u];
    return vec3(dot(s.xyz, r), dot(vec3(s.y, s.w, t.x), r), dot(vec3(s.z, t.x, t.y), r));
}
