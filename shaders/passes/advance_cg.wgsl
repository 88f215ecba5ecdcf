//! Conjugate gradients by many workgroups, second and last of an iteration, a workgroup a group of nodes (`shared/advance`). call.extra: ODD; or
//! BEGINS, for z of the residual as it is.
// use shared/grid
// use shared/team_64
// use shared/totals
// use shared/parity_called
// use shared/advance

var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(64)
fn advance_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.groups, 1u);
    if !share.runs {
        return;
    }
    let begins = (call.extra & BEGINS) != 0u;
    var alpha = 0.0;
    if !begins {
        let now = scalars_of(local, scalars_at(share.member) + parity());
        if now.z != 0.0 {
            return;
        }
        alpha = length_of(local, share.member, now.x, share.first == 0u);
        if alpha == 0.0 {
            return;
        }
    }
    advance_group(local, share.member, share.home, share.first, alpha, begins);
}
