//! Conjugate gradients by workgroups that stay: all iterations in one dispatch, with two meetings an iteration in place of the ends of two dispatches.
//! Workgroup k of `shape.crew` takes every crew-th slice and group; sums are those of one dispatch a pass, in the same order whoever makes them.
//! call.extra: iterations, an even number, times eight.
// coherent
// use shared/grid
// use shared/team_256
// use shared/totals
// use shared/turn
// use shared/row_slices
// use shared/advance
// use shared/meeting

var<storage, read_write> solving: array<vec4<f32>>;

var<private> is_odd: u32;

fn parity() -> u32 {
    return is_odd;
}

@compute @workgroup_size(256)
fn persist_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.crew, 1u);
    if !share.runs {
        return;
    }
    let system = share.member;
    let first = share.first;
    var came = 0u;
    for (var k = 0u; k < call.extra / 8u; k++) {
        is_odd = k % 2u;
        let now = turn_cg(local, system, first == 0u);
        if now.z != 0.0 {
            // What comes next reads the scalars of an odd iteration.
            if k % 2u == 0u {
                is_odd = 1u;
                _ = turn_cg(local, system, first == 0u);
            }
            break;
        }
        for (var slice = first; slice < shape.slices; slice += shape.crew) {
            multiply_slice(local, Share(system, share.home, slice, true));
        }
        came += shape.crew;
        if !meet(local, system, came) {
            break;
        }
        let alpha = length_of(local, system, now.x, first == 0u);
        if alpha != 0.0 {
            for (var own = first; own < shape.groups; own += shape.crew) {
                advance_group(local, system, share.home, own, alpha, false);
            }
        }
        came += shape.crew;
        if !meet(local, system, came) {
            break;
        }
    }
    if local == 0u {
        let left = leave(system, shape.crew);
        if left.x && left.y {
            cg_sums[scalars_at(system) + 1u].z = ALONE;
        }
    }
}
