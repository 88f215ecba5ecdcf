//! What tangent_cells keeps of every cell, 30 vectors each: R, G⁻¹ and R D_i per corner. The fourth components of the first eight
//! hold the guard against inversion: second and first derivative of its energy by d (times E V; nothing where it does not act), and
//! the stretch xx, xy, xz, yy, yz, zz.
// use shared/guard

var<storage, read> tangents: array<vec4<f32>>;

fn three(at: u32) -> mat3x3<f32> {
    return mat3x3(tangents[at].xyz, tangents[at + 1u].xyz, tangents[at + 2u].xyz);
}

fn has_guard(at: u32) -> bool {
    return tangents[at].w != 0.0;
}

// a bᵀ.
fn dyad(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(a * b.x, a * b.y, a * b.z);
}

fn inner(a: mat3x3<f32>, b: mat3x3<f32>) -> f32 {
    return dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2]);
}

// Change of the guard's stress for a change `a` of F, both in the body frame.
fn guard_rate(at: u32, a: mat3x3<f32>) -> mat3x3<f32> {
    let xy = tangents[at + 3u].w;
    let xz = tangents[at + 4u].w;
    let yz = tangents[at + 6u].w;
    let s = mat3x3(vec3(tangents[at + 2u].w, xy, xz), vec3(xy, tangents[at + 5u].w, yz), vec3(xz, yz, tangents[at + 7u].w));
    let gradient = guard_gradient(s);
    let i = trace3(s);
    let i2 = i * i;
    let i3 = i2 * i;
    let n = norm2(s);
    let j = determinant(s);
    let c = cofactors(s);
    let di = trace3(a);
    let dn = 2.0 * inner(s, a);
    let dj = inner(c, a);
    let turn = cross_matrix(three(at + 3u) * axial(a));
    let onto = (-n / i3 - 6.0 * j / (i2 * i2)) * di + 0.5 * dn / i2 + 2.0 * dj / i3;
    let dc = mat3x3(
        cross(a[1], s[2]) + cross(s[1], a[2]),
        cross(a[2], s[0]) + cross(s[2], a[0]),
        cross(a[0], s[1]) + cross(s[0], a[1]),
    );
    let second = identity3() * onto + turn * (0.5 * (1.0 + n / i2) + 2.0 * j / i3) + s * (di / i2) - a * (1.0 / i)
        + c * (2.0 * di / i3) - dc * (1.0 / i2);
    return gradient * (tangents[at].w * inner(gradient, a)) + second * tangents[at + 1u].w;
}

// Second derivative of the guard's energy by two corners, in the body frame.
fn guard_block(at: u32, row: vec3<f32>, column: vec3<f32>) -> mat3x3<f32> {
    let at_row = slope_of(row);
    let along = slope_of(column);
    var block: mat3x3<f32>;
    for (var c = 0u; c < 3u; c++) {
        let axis = vec3(f32(c == 0u), f32(c == 1u), f32(c == 2u));
        block[c] = guard_rate(at, dyad(axis, along)) * at_row;
    }
    return block;
}
