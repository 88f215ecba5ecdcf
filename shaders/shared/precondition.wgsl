//! Block-Jacobi: the inverse of a node's own block, from invert_diagonal; and how far groups of nodes have turned, from turn_groups.

// [B][N] inverses of two vectors each, then [B][groups] rotations since rest as quaternions.
var<storage, read> inverses: array<vec4<f32>>;

fn turn_of_group(member: u32, g: u32) -> vec4<f32> {
    return inverses[2u * shape.members * shape.nodes + member * shape.groups + g];
}

// `a`: a node of the member whose matrix it is.
fn scaled(a: u32, r: vec3<f32>) -> vec3<f32> {
    let s = inverses[2u * a];
    let t = inverses[2u * a + 1u];
    return vec3(dot(s.xyz, r), dot(vec3(s.y, s.w, t.x), r), dot(vec3(s.z, t.x, t.y), r));
}
