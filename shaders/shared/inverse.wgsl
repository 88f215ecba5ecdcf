//! The inverse of a node's own block, as invert_diagonal keeps it: (xx, xy, xz, yy), (yz, zz, trace without inertia, 1 if not positive definite).

fn by_inverse(s: vec4<f32>, t: vec4<f32>, r: vec3<f32>) -> vec3<f32> {
    return vec3(dot(s.xyz, r), dot(vec3(s.y, s.w, t.x), r), dot(vec3(s.z, t.x, t.y), r));
}
