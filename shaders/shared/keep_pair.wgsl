//! Two sums over a workgroup, of forces and torques and what comes with them, kept side by side in `cg_sums`.

fn keep_pair(local: u32, place: u32, force: vec4<f32>, torque: vec4<f32>) {
    let whole_force = total(local, force);
    let whole_torque = total(local, torque);
    if local == 0u {
        cg_sums[place] = whole_force;
        cg_sums[place + 1u] = whole_torque;
    }
}
