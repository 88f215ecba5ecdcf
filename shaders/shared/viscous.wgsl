//! Damping and viscosity of elastic points: strains of the past, which strain_elastic summed up.
// use shared/flow

// [B][points][2]: Σ w G over the past states; xx, yy, zz, then yz, zx, xy.
var<storage, read> past_strains: array<vec4<f32>>;

// G₁ minus the past's.
fn strained(member: u32, point: u32, h: mat3x3<f32>) -> mat3x3<f32> {
    let at = 2u * (member * shape.elastic + point);
    let d = past_strains[at].xyz;
    let o = past_strains[at + 1u].xyz;
    return green(h) - mat3x3(vec3(d.x, o.z, o.y), vec3(o.z, d.y, o.x), vec3(o.y, o.x, d.z));
}

// F S with S = C (G₁ − G̃), for a damping of one over the length of the solve; nothing in a static problem.
fn viscous(member: u32, point: u32, h: mat3x3<f32>, lame: vec2<f32>) -> mat3x3<f32> {
    if call.mode == 0u {
        return mat3x3<f32>();
    }
    return (identity3() + h) * linear_stress(strained(member, point, h), lame);
}

// The material's viscous stress S = ∂φ/∂G.
struct Flow {
    energy: f32,
    stress: mat3x3<f32>,
    // Factors of dG and of G₁ − G̃ in the change of S.
    own: f32,
    along: f32,
    strain: mat3x3<f32>,
}

fn flow_at(m: Member, member: u32, point: u32, h: mat3x3<f32>) -> Flow {
    var r: Flow;
    if call.mode == 0u || m.flow.x == 0.0 || has_mean(point) {
        return r;
    }
    r.strain = strained(member, point, h);
    let loss = flow_loss(m, contract(r.strain, r.strain));
    r.energy = loss.x;
    r.own = 2.0 * loss.y;
    r.along = 4.0 * loss.z;
    r.stress = r.strain * r.own;
    return r;
}

// Change of S with Green's strain; symmetric.
fn flow_rate(r: Flow, dg: mat3x3<f32>) -> mat3x3<f32> {
    return dg * r.own + r.strain * (r.along * contract(r.strain, dg));
}
