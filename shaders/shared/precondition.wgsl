//! Block-Jacobi: the inverse of a node's own block, from invert_diagonal; and how far groups of nodes have turned, from turn_groups.
// use shared/inverse

// [B][N] inverses of two vectors each, then [B][groups] rotations since rest as quaternions.
var<storage, read> inverses: array<vec4<f32>>;

fn turn_of_group(member: u32, g: u32) -> vec4<f32> {
    return inverses[2u * shape.members * shape.nodes + member * shape.groups + g];
}

// `a`: a node of the member whose matrix it is.
fn scaled(a: u32, r: vec3<f32>) -> vec3<f32> {
    return by_inverse(inverses[2u * a], inverses[2u * a + 1u], r);
}
