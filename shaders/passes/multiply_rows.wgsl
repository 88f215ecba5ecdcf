//! Conjugate gradients by many workgroups, first of an iteration: has it converged? If not, A p with the assembled matrix (`shared/row_slices`).
//! call.extra: ODD; or OF_SOLUTION, for A x.
// use shared/team_256
// use shared/totals
// use shared/parity_called
// use shared/turn
// use shared/row_slices

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn multiply_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.slices, 1u);
    if !share.runs {
        return;
    }
    if !multiplies(local, share) {
        return;
    }
    multiply_slice(local, share);
}
