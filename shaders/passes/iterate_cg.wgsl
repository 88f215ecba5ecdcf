//! A bounded number of conjugate-gradient iterations, one workgroup per member and column; every scalar stays on the device. Ends in the
//! norm sqrt(rᵀ M⁻¹ r), to which a nearly massless node counts as much as any other. call.extra: FOR_DIRECTION or
//! FOR_DERIVATIVE.
// use shared/asks
// use shared/mix
// use shared/iteration
// use shared/product
// use shared/precondition_alone
// use shared/leave_cg

var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<storage, read> values: array<f32>;

@compute @workgroup_size(256)
fn iterate_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    let m = members[p.home];
    let mix = mix_of(m);
    var n = newton_of(local, p.member);
    if n.stage != WANTS_SOLVE {
        return;
    }
    let rest = solving_part(REST);
    let image = solving_part(IMAGE);
    // Between chunks: rᵀ M⁻¹ r of the right-hand side, β of the next iteration, and xᵀ times the right-hand side.
    let kept = scalars_of(local, scalars_at(p.member));
    var of_rhs = kept.x;
    var beta = kept.y;
    var along_rhs = kept.z;
    if n.cg == 0u {
        n.rz = precondition_alone(local, p.member, p.home);
        of_rhs = n.rz;
        beta = 0.0;
        along_rhs = 0.0;
    }
    var ended = is_small(n.rz, of_rhs, n);
    var negative = false;
    for (var iteration = 0u; iteration < shape.chunk; iteration++) {
        if ended {
            break;
        }
        storageBarrier();
        set_way(n.cg & 1u, beta);
        var curvature = vec4(0.0);
        for (var i = local; i < shape.nodes; i += 256u) {
            let a = at_node(p.member, i);
            let way = along_way(a);
            var q = vec3(0.0);
            if !has_mass_matrix() {
                q = (mix.inertia * node_mass(m, p.home, i)) * way;
            }
            for (var k = block_rows[i]; k < block_rows[i + 1u]; k++) {
                let x = along_way(at_node(p.member, columns[k]));
                let v = (p.home * shape.blocks + k) * 9u;
                q += vec3(
                    values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
                    values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
                    values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
                );
                if has_mass_matrix() {
                    q += (mix.inertia * block_mass(m, p.home, k)) * x;
                }
            }
            q = with_masses(q, mix.inertia, p.member, p.home, i);
            solving[way_now() + a] = vec4(way, 0.0);
            solving[image + a] = vec4(q, 0.0);
            curvature.x += dot(way, q);
        }
        let bend = total(local, curvature).x;
        n.cg += 1u;
        if bend <= 0.0 || !is_finite(bend) {
            negative = true;
            break;
        }
        let alpha = n.rz / bend;
        along_rhs += alpha * n.rz;
        for (var i = local; i < shape.nodes; i += 256u) {
            let a = at_node(p.member, i);
            solving[a] += alpha * solving[way_now() + a];
            solving[rest + a] = vec4(solving[rest + a].xyz - alpha * solving[image + a].xyz, 0.0);
        }
        restrict_alone(local, p.member, p.home);
        let rz = precondition_alone(local, p.member, p.home);
        beta = rz / n.rz;
        n.rz = rz;
        ended = is_small(rz, of_rhs, n) || n.cg >= shape.most;
    }
    if local == 0u {
        cg_sums[scalars_at(p.member)] = vec4(of_rhs, beta, along_rhs, 0.0);
    }
    leave_cg(local, p.member, n, of_rhs, along_rhs, negative, ended, call.extra == FOR_DERIVATIVE);
}
