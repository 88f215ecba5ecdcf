//! Laws of cells on tetrahedra: every element gives them the strain ε = S − I of its mean F = R S, and its volume. Twin of
//! palpate-cpu/src/terms/tet_laws.rs and palpate-model/src/materials/stretching.rs. Passes have an invocation per element, and no barriers:
//! software adapters take minutes to split functions of this size at them. Each pass has one call of the laws, in a loop, as compilers write out every call.
//!
//! Forces conjugate to ε are symmetric matrices T with dψ = T : dε; a law is differentiated by the six components of ε in hyper-dual numbers.
// use shared/elastic
// use shared/laws

// [B][elements][2]: Σ w ε over the past states; xx, yy, zz, then yz, zx, xy.
var<storage, read> past_stretches: array<vec4<f32>>;

// Strains of an element at one state.
struct Stretch {
    // R and S.
    turn: mat3x3<f32>,
    s: mat3x3<f32>,
    // S − I.
    strain: mat3x3<f32>,
    // Inverse of tr(S) I − S.
    pairs: mat3x3<f32>,
}

fn mean_point(element: u32) -> u32 {
    return shape.per_element * element + shape.per_element - 1u;
}

fn stretch_at(h: mat3x3<f32>) -> Stretch {
    let excess = excess_of(rotation_of(h));
    var a: Stretch;
    a.turn = identity3() + excess;
    let half = transpose(excess) + transpose(a.turn) * h;
    a.strain = (half + transpose(half)) * 0.5;
    a.s = identity3() + a.strain;
    a.pairs = pair_inverse(a.s);
    return a;
}

// Rᵀ dR along a change of F.
fn turn_along(a: Stretch, df: mat3x3<f32>) -> mat3x3<f32> {
    return cross_matrix(a.pairs * axial(transpose(a.turn) * df));
}

// Change of ε along a change of F.
fn strain_along(a: Stretch, df: mat3x3<f32>) -> mat3x3<f32> {
    let ds = transpose(a.turn) * df - turn_along(a, df) * a.s;
    return (ds + transpose(ds)) * 0.5;
}

// Its transpose: the stress P with P : dF = T : dε.
fn stress_back(a: Stretch, t: mat3x3<f32>) -> mat3x3<f32> {
    return a.turn * (t - cross_matrix(a.pairs * axial(t * a.strain)));
}

// Change of that along a change of F, with T as it is.
fn stress_bend(a: Stretch, t: mat3x3<f32>, df: mat3x3<f32>) -> mat3x3<f32> {
    let ds = strain_along(a, df);
    let v = a.pairs * axial(t * a.strain);
    let dv = a.pairs * (axial(t * ds) - (v * trace3(ds) - ds * v));
    return a.turn * (turn_along(a, df) * (t - cross_matrix(v)) - cross_matrix(dv));
}

// ε̃; nothing in a static problem.
fn past_stretch(member: u32, element: u32) -> mat3x3<f32> {
    if call.mode == 0u {
        return mat3x3<f32>();
    }
    let at = 2u * (member * shape.elements + element);
    let d = past_stretches[at].xyz;
    let o = past_stretches[at + 1u].xyz;
    return mat3x3(vec3(d.x, o.z, o.y), vec3(o.z, d.y, o.x), vec3(o.y, o.x, d.z));
}

// The change of ε that component c stands for.
fn unit_strain(c: u32) -> mat3x3<f32> {
    var e = mat3x3<f32>();
    let i = select(c, (c + 1u) % 3u, c >= 3u) % 3u;
    let j = select(c, (c + 2u) % 3u, c >= 3u) % 3u;
    e[i][j] = 1.0;
    e[j][i] = 1.0;
    return e;
}

// ½ x : C : x over E, where x changes by `first` and by `second`, and with the latter the Lamé parameters.
fn half_square(x: mat3x3<f32>, first: mat3x3<f32>, second: mat3x3<f32>, lame: vec2<f32>, dlame: vec2<f32>) -> Dual {
    let s = linear_stress(x, lame);
    let changed = linear_stress(x, dlame);
    return vec4(
        max(0.5 * contract(s, x), 0.0),
        contract(s, first),
        contract(s, second) + 0.5 * contract(changed, x),
        contract(linear_stress(first, lame), second) + contract(changed, first),
    );
}

// Where laws are asked, with two changes.
struct Asked {
    // ε₁ or the increment, by the part; and ε̃.
    x: mat3x3<f32>,
    past: mat3x3<f32>,
    first: mat3x3<f32>,
    first_past: mat3x3<f32>,
    second: mat3x3<f32>,
    second_past: mat3x3<f32>,
    // λ/E and μ/E, and their second change.
    lame: vec2<f32>,
    dlame: vec2<f32>,
}

fn put_scalars(part: u32, q: Asked) {
    input[0] = half_square(q.x, q.first, q.second, q.lame, q.dlame);
    if part == LOSS_PART {
        input[1] = half_square(q.past, q.first_past, q.second_past, q.lame, q.dlame);
        return;
    }
    input[1] = vec4(q.x[0].x, q.first[0].x, q.second[0].x, 0.0);
    input[2] = vec4(q.x[1].y, q.first[1].y, q.second[1].y, 0.0);
    input[3] = vec4(q.x[2].z, q.first[2].z, q.second[2].z, 0.0);
    input[4] = vec4(q.x[1].z, q.first[1].z, q.second[1].z, 0.0);
    input[5] = vec4(q.x[2].x, q.first[2].x, q.second[2].x, 0.0);
    input[6] = vec4(q.x[0].y, q.first[0].y, q.second[0].y, 0.0);
}

// What laws say over E: value, T, and its change.
struct Said {
    value: f32,
    t: mat3x3<f32>,
    change: mat3x3<f32>,
}
