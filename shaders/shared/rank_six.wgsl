//! The part of a cell's tangent that comes with its rotation, for a multiple of its matrix and a stress: see tangent_cells.
// use shared/cells

// R⁻¹ of this lane's R D_i, D = B + ½QΩ − s(N − ½TΩ), for s K with s = `scale` and the body-frame force y without resultant; without B
// and Q where only the convex part is wanted.
fn rank_six(pose: Pose, matrix: u32, corner: u32, sign: vec3<f32>, scale: f32, y: vec3<f32>, convex: bool) -> mat3x3<f32> {
    // N_i: column m is Σ_j K_ij (e_m × z_j).
    let nx = stiff(matrix, corner, vec3(0.0, -pose.z.z, pose.z.y));
    let ny = stiff(matrix, corner, vec3(pose.z.z, 0.0, -pose.z.x));
    let nz = stiff(matrix, corner, vec3(-pose.z.y, pose.z.x, 0.0));
    // T = ZᵀKZ: rows Σ z_i × N_i.
    let tx = sum8(cross(pose.z, nx));
    let ty = sum8(cross(pose.z, ny));
    let tz = sum8(cross(pose.z, nz));
    var q = mat3x3(tx, ty, tz) * scale;
    let f = force_body(pose, y, sign);
    let bend = spin_stiffness(pose, y);
    var half = mat3x3(nx, ny, nz) * -scale;
    if !convex {
        half -= cross_matrix(f);
        q += bend;
    }
    // Ω_i = −[b_i]× G⁻¹.
    let omega = cross_matrix(sign * (-0.25 / shape.h)) * pose.g;
    return half + omega * (q * 0.5);
}
