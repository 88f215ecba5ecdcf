//! Of a derivative's solve by one workgroup whose residual is said to be small: the true one takes its place, and the solve has ended or begins anew
//! with what is left.
// use shared/parity_called
// use shared/asks
// use shared/multiply_alone
// use shared/true_rest
// use shared/precondition_alone
// use shared/leave_cg

@compute @workgroup_size(256)
fn look_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    var n = newton_of(local, p.member);
    // What iterate_cg has left there.
    let kept = scalars_of(local, scalars_at(p.member));
    let said = scalars_of(local, scalars_at(p.member) + 1u).xyz;
    if n.stage != WANTS_SOLVE || !(is_small(said, kept.x, n) || n.cg >= shape.most) {
        return;
    }
    set_solution();
    _ = multiply_alone(local, p);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        solving[solving_part(REST) + a] = solving[solving_part(RIGHT) + a] - solving[solving_part(IMAGE) + a];
    }
    restrict_alone(local, p.member, p.home);
    let rests = precondition_alone(local, p.member, p.home);
    n.rz = rests.x;
    let ended = is_true(rests, kept.x, n);
    if !ended {
        n.trial += 1u;
        if local == 0u {
            cg_sums[scalars_at(p.member)].y = ANEW;
            cg_sums[scalars_at(p.member) + 1u] = vec4(rests, 0.0);
        }
    }
    leave_cg(local, p.member, n, rests, kept.x, kept.z, false, ended, true);
}
