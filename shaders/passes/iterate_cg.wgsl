//! A bounded number of conjugate-gradient iterations, one workgroup per member and column; every scalar stays on the device. Ends in the
//! norm sqrt(rᵀ M⁻¹ r), to which a nearly massless node counts as much as any other. call.extra: FOR_DIRECTION or
//! FOR_DERIVATIVE, whose end is look_cg's business.
// use shared/parity_called
// use shared/asks
// use shared/multiply_alone
// use shared/iteration
// use shared/precondition_alone
// use shared/leave_cg

@compute @workgroup_size(256)
fn iterate_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    var n = newton_of(local, p.member);
    if n.stage != WANTS_SOLVE {
        return;
    }
    let exact = call.extra == FOR_DERIVATIVE;
    // Between chunks: rᵀ M⁻¹ r of the right-hand side and of the iteration before and xᵀ times the right-hand side; then the sums of the residual.
    let kept = scalars_of(local, scalars_at(p.member));
    var of_rhs = kept.x;
    var before = kept.y;
    var along_rhs = kept.z;
    var rests = scalars_of(local, scalars_at(p.member) + 1u).xyz;
    if n.cg == 0u {
        rests = precondition_alone(local, p.member, p.home);
        n.rz = rests.x;
        of_rhs = n.rz;
        before = 0.0;
        along_rhs = 0.0;
    }
    var small = is_small(rests, of_rhs, n) || n.cg >= shape.most;
    var negative = false;
    for (var iteration = 0u; iteration < shape.chunk; iteration++) {
        if small {
            break;
        }
        set_way(n.cg & 1u, way_factor_of(n.rz, before));
        let curvature = multiply_alone(local, p);
        n.cg += 1u;
        if !is_curved(curvature) {
            negative = true;
            break;
        }
        let alpha = n.rz / curvature;
        along_rhs += alpha * n.rz;
        for (var i = local; i < shape.nodes; i += 256u) {
            let a = at_node(p.member, i);
            let way = operand_at(a);
            solving[a] += vec4(alpha * way, 0.0);
            solving[solving_part(REST) + a] -= alpha * solving[solving_part(IMAGE) + a];
            solving[way_at + a] = vec4(way, 0.0);
        }
        restrict_alone(local, p.member, p.home);
        before = n.rz;
        rests = precondition_alone(local, p.member, p.home);
        n.rz = rests.x;
        small = is_small(rests, of_rhs, n) || n.cg >= shape.most;
    }
    if local == 0u {
        cg_sums[scalars_at(p.member)] = vec4(of_rhs, before, along_rhs, 0.0);
        cg_sums[scalars_at(p.member) + 1u] = vec4(rests, 0.0);
    }
    leave_cg(local, p.member, n, rests, of_rhs, along_rhs, negative, small && !exact, exact);
}
