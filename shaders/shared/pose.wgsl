//! Variational corotation of a cell in single precision, one lane per corner: rest-frame deformation q and its first and second
//! derivatives. Twin of palpate-model/src/cutcells/corotation.rs, where the formulas stand; names are the same.
// use shared/lanes
// use shared/rotation
// use shared/mix

struct Pose {
    // R, S, G⁻¹.
    r: mat3x3<f32>,
    s: mat3x3<f32>,
    g: mat3x3<f32>,
    // This lane's arm and deformation [m].
    z: vec3<f32>,
    q: vec3<f32>,
}

fn sign_of(corner: u32) -> vec3<f32> {
    return vec3(f32(corner & 1u), f32((corner >> 1u) & 1u), f32((corner >> 2u) & 1u)) * 2.0 - vec3(1.0);
}

fn centred(v: vec3<f32>) -> vec3<f32> {
    return v - sum8(v) * 0.125;
}

// H of displacements without mean: (1/4h) Σ d σᵀ.
fn gradient_of(d: vec3<f32>, sign: vec3<f32>) -> mat3x3<f32> {
    let a = sum8(d * sign.x);
    let b = sum8(d * sign.y);
    let c = sum8(d * sign.z);
    return mat3x3(a, b, c) * (0.25 / shape.h);
}

// Pose of displacements `u` (any common part left out).
fn pose_of(u: vec3<f32>, sign: vec3<f32>) -> Pose {
    let d = centred(u);
    let h = gradient_of(d, sign);
    let e = excess_of(rotation_of(h));
    let arm = sign * (0.5 * shape.h);
    var p: Pose;
    p.r = identity3() + e;
    p.q = transpose(p.r) * d + transpose(e) * arm;
    p.z = p.q + arm;
    p.s = stretch_of(e, h);
    p.g = pair_inverse(p.s);
    return p;
}

// ω of body-frame increments.
fn spin_body(p: Pose, d: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    return p.g * (sum8(cross(sign, d)) * (0.25 / shape.h));
}

// This lane's share of the transpose.
fn spin_adjoint_body(p: Pose, g: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    return cross((p.g * g) * (0.25 / shape.h), sign);
}

// dq of world-frame increments.
fn strain_rate(p: Pose, dx: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    let d = centred(transpose(p.r) * dx);
    return d - cross(spin_body(p, d, sign), p.z);
}

// Body-frame force of y (without resultant).
fn force_body(p: Pose, y: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    return y - spin_adjoint_body(p, sum8(cross(p.z, y)), sign);
}

// World-frame gradient of y·q.
fn force(p: Pose, y: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    return p.r * force_body(p, centred(y), sign);
}

// Q of the second derivative, for y without resultant.
fn spin_stiffness(p: Pose, y: vec3<f32>) -> mat3x3<f32> {
    let m = mat3x3(sum8(p.z * y.x), sum8(p.z * y.y), sum8(p.z * y.z));
    let half = m + p.s * cross_matrix(p.g * sum8(cross(p.z, y)));
    return (half + transpose(half)) * 0.5 - identity3() * trace3(m);
}

// Second derivative of y·q times body-frame increments d (both without mean).
fn second_body(p: Pose, y: vec3<f32>, d: vec3<f32>, sign: vec3<f32>) -> vec3<f32> {
    let f = force_body(p, y, sign);
    let omega = spin_body(p, d, sign);
    return spin_adjoint_body(p, sum8(cross(f, d)) + spin_stiffness(p, y) * omega, sign) + cross(omega, f);
}
