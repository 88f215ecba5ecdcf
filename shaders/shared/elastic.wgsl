//! Elastic points: stencils with gradients, each of which stands for a volume and has the material at F itself. Twin of
//! palpate-cpu/src/terms/elastic_points. Strains are counted from differences of displacements, so that a long way costs no digits.
// use shared/mix
// use shared/fields
// use shared/stencil
// use shared/rotation
// use shared/unstrained
// use materials/all

// [m³]
var<body> elastic_volumes: array<f32>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;

// What λ' of a local point stays below, over μ.
override local_share: f32;

fn element_of(point: u32) -> u32 {
    return point / shape.per_element;
}

// True of the point that has the mean of an element of several points.
fn has_mean(point: u32) -> bool {
    return shape.per_element > 1u && point % shape.per_element == shape.per_element - 1u;
}

// λ/E and μ/E that act at a point, and their derivatives by Poisson's ratio. Twin of `Share` in palpate-model/src/space/points.rs: of an element
// of several points the last has the mean, and what of λ is more than local points bear.
fn lame_at(m: Member, point: u32) -> vec4<f32> {
    if shape.per_element == 1u {
        return m.lame;
    }
    let stiff = local_share * m.lame.y;
    let sum = m.lame.x + stiff;
    let part = m.lame.x / sum;
    if has_mean(point) {
        return vec4(m.lame.x * part, 0.0, part * ((2.0 - part) * m.lame.z - part * local_share * m.lame.w), 0.0);
    }
    let kept = stiff / sum;
    return vec4(m.lame.x * kept, m.lame.y, kept * kept * m.lame.z + local_share * part * part * m.lame.w, m.lame.w);
}

fn contract(a: mat3x3<f32>, b: mat3x3<f32>) -> f32 {
    return dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2]);
}

// Volume of a point in the stress-free shape [m³].
fn volume_at(member: u32, point: u32) -> f32 {
    return elastic_volumes[point] * swelling(member * shape.elastic + point);
}

// H = F − I, measured from the stress-free shape.
fn measured(member: u32, point: u32, h: mat3x3<f32>) -> mat3x3<f32> {
    let at = member * shape.elastic + point;
    return by_unstrained(at, h) - shift_of(at);
}

// Displacement gradients H of both states, and the gradient of `probe`; weights of a gradient sum to zero.
fn gradient_next(member: u32, point: u32) -> mat3x3<f32> {
    let o = at_node(member, stencil_entries[stencil_rows[point]].node);
    var h = mat3x3<f32>();
    for (var k = stencil_rows[point]; k < stencil_rows[point + 1u]; k++) {
        let a = at_node(member, stencil_entries[k].node);
        h += outer((next[a].xyz - next[o].xyz) + (next[part(1u) + a].xyz - next[part(1u) + o].xyz), stencil_gradients[k].xyz);
    }
    return measured(member, point, h);
}

fn gradient_now(member: u32, point: u32) -> mat3x3<f32> {
    let o = at_node(member, stencil_entries[stencil_rows[point]].node);
    var h = mat3x3<f32>();
    for (var k = stencil_rows[point]; k < stencil_rows[point + 1u]; k++) {
        let a = at_node(member, stencil_entries[k].node);
        h += outer((now[a].xyz - now[o].xyz) + (now[part(1u) + a].xyz - now[part(1u) + o].xyz), stencil_gradients[k].xyz);
    }
    return measured(member, point, h);
}

// H of the old or the new state.
fn gradient_of(member: u32, point: u32, old: bool) -> mat3x3<f32> {
    if old {
        return gradient_now(member, point);
    }
    return gradient_next(member, point);
}

fn gradient_probe(member: u32, point: u32) -> mat3x3<f32> {
    let o = at_node(member, stencil_entries[stencil_rows[point]].node);
    var h = mat3x3<f32>();
    for (var k = stencil_rows[point]; k < stencil_rows[point + 1u]; k++) {
        h += outer(probe[at_node(member, stencil_entries[k].node)].xyz - probe[o].xyz, stencil_gradients[k].xyz);
    }
    return by_unstrained(member * shape.elastic + point, h);
}

// Green's strain.
fn green(h: mat3x3<f32>) -> mat3x3<f32> {
    return (h + transpose(h) + transpose(h) * h) * 0.5;
}

// Change of Green's strain when F changes.
fn green_rate(f: mat3x3<f32>, df: mat3x3<f32>) -> mat3x3<f32> {
    let half = transpose(f) * df;
    return (half + transpose(half)) * 0.5;
}

// λ tr(G) I + 2μ G.
fn linear_stress(g: mat3x3<f32>, lame: vec2<f32>) -> mat3x3<f32> {
    return identity3() * (lame.x * trace3(g)) + g * (2.0 * lame.y);
}

// What a material says at H: energy ψ, stress ∂ψ/∂F, and the stress's change along a change of H and of the Lamé parameters.
struct Response {
    energy: f32,
    stress: mat3x3<f32>,
    change: mat3x3<f32>,
}

// μ |S − I|² + ½λ tr²(S − I) with F = R S, by formula: in single precision S − I must not be a difference of large numbers.
fn corotated(h: mat3x3<f32>, dh: mat3x3<f32>, lame: vec2<f32>, dlame: vec2<f32>) -> Response {
    let excess = excess_of(rotation_of(h));
    let r = identity3() + excess;
    let s = stretch_of(excess, h);
    let half = transpose(excess) + transpose(r) * h;
    let e = (half + transpose(half)) * 0.5;
    let stress = linear_stress(e, lame);
    let m = transpose(r) * dh;
    let turn = cross_matrix(pair_inverse(s) * axial(m));
    let ds = m - turn * s;
    var p: Response;
    p.energy = 0.5 * contract(stress, e);
    p.stress = r * stress;
    p.change = r * (turn * stress + linear_stress((ds + transpose(ds)) * 0.5, lame) + linear_stress(e, dlame));
    return p;
}

// Component of a matrix, counted row by row.
fn component(m: mat3x3<f32>, k: u32) -> f32 {
    return m[k % 3u][k / 3u];
}

fn lifted(h: mat3x3<f32>, dh: mat3x3<f32>, k: u32, along: u32) -> Dual {
    return vec4(component(h, k), f32(k == along), component(dh, k), 0.0);
}

fn respond_at(h: mat3x3<f32>, dh: mat3x3<f32>, lame: vec2<f32>, dlame: vec2<f32>) -> Response {
    let material = (shape.fields >> MATERIAL_AT) & MOST_MATERIALS;
    if material == 0u {
        return corotated(h, dh, lame, dlame);
    }
    let lambda = vec4(lame.x, 0.0, dlame.x, 0.0);
    let mu = vec4(lame.y, 0.0, dlame.y, 0.0);
    var p: Response;
    for (var k = 0u; k < 9u; k++) {
        let all = Gradient(
            Three(lifted(h, dh, 0u, k), lifted(h, dh, 1u, k), lifted(h, dh, 2u, k)),
            Three(lifted(h, dh, 3u, k), lifted(h, dh, 4u, k), lifted(h, dh, 5u, k)),
            Three(lifted(h, dh, 6u, k), lifted(h, dh, 7u, k), lifted(h, dh, 8u, k)),
        );
        let v = material_energy(material, all, lambda, mu);
        p.energy = v.x;
        p.stress[k % 3u][k / 3u] = v.y;
        p.change[k % 3u][k / 3u] = v.w;
    }
    return p;
}

fn stress_at(h: mat3x3<f32>, lame: vec2<f32>) -> Response {
    return respond_at(h, mat3x3<f32>(), lame, vec2(0.0));
}

// Where a point's stress begins in `elastic_stress`.
fn stress_place(member: u32, point: u32) -> u32 {
    return 3u * (member * shape.elastic + point);
}
