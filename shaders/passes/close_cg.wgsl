//! Conjugate gradients by many workgroups, now and then after an odd iteration: members that are done go on to what comes next. A derivative whose
//! residual was only said to be small goes on. call.extra: FOR_DIRECTION or FOR_DERIVATIVE.
// use shared/parity_called
// use shared/asks
// use shared/grid
// use shared/team_256
// use shared/totals
// use shared/true_rest
// use shared/leave_cg

@compute @workgroup_size(256)
fn close_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    var n = newton_of(local, p.member);
    let exact = call.extra == FOR_DERIVATIVE;
    let s = scalars_of(local, scalars_at(p.member) + 1u);
    if s.z == ALONE {
        if local == 0u {
            n.stage = IDLE;
            newton[p.member] = n;
            health[p.member] = Health(STRANDED, call.step + call.mode, vec2(0.0));
        }
        return;
    }
    let update = scalars_of(local, scalars_at(p.member) + 3u);
    let rests = sum_rests(local, p.member);
    let negative = s.z == 2.0 || (s.z == 0.0 && update.x != 0.0);
    var ended = !negative && (s.z == 1.0 || is_small(rests, s.w, n) || s.y >= f32(shape.most));
    // A solve that had ended before the last iteration left its sum with the update before.
    let along_rhs = max(update.y, scalars_of(local, scalars_at(p.member) + 2u).y);
    n.rz = rests.x;
    n.cg = u32(s.y);
    if ended && exact && !is_true(rests, s.w, n) {
        ended = false;
        n.trial += 1u;
        if local == 0u {
            cg_sums[scalars_at(p.member) + 1u] = vec4(ANEW, s.y, 0.0, s.w);
        }
    }
    leave_cg(local, p.member, n, rests, s.w, along_rhs, negative, ended, exact);
}
