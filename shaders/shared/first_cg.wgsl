//! Before the first iteration of conjugate gradients.

// The residual of a solve from zero, and no way that came before.
fn begin_at(a: u32, rhs: vec3<f32>) {
    solving[a] = vec4(0.0);
    solving[solving_part(REST) + a] = vec4(rhs, 0.0);
    solving[solving_part(ODD_WAY) + a] = vec4(0.0);
}

// No iteration came before.
fn first_cg(local: u32, system: u32) {
    if local < 4u {
        cg_sums[scalars_at(system) + local] = vec4(0.0);
    }
}
