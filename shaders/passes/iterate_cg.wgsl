//! A bounded number of conjugate-gradient iterations, one workgroup per member and column; every scalar stays on the device. Ends in the
//! norm sqrt(rᵀ M⁻¹ r), to which a nearly massless node counts as much as any other. call.extra: FOR_DIRECTION or
//! FOR_DERIVATIVE.
// use shared/asks
// use shared/mix
// use shared/product
// use shared/totals
// use shared/precondition
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
    let way = solving_part(ALONG_WAY);
    let image = solving_part(IMAGE);
    var ended = false;
    var negative = false;
    for (var iteration = 0u; iteration < shape.chunk; iteration++) {
        storageBarrier();
        var curvature = vec4(0.0);
        for (var i = local; i < shape.nodes; i += 256u) {
            var q = vec3(0.0);
            if !has_mass_matrix() {
                q = (mix.inertia * node_mass(m, p.home, i)) * along_way(at_node(p.member, i));
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
            let a = at_node(p.member, i);
            solving[image + a] = vec4(q, 0.0);
            curvature.x += dot(solving[way + a].xyz, q);
        }
        let bend = total(local, curvature).x;
        n.cg += 1u;
        if !(bend > 0.0) {
            negative = true;
            break;
        }
        let alpha = n.rz / bend;
        var left = vec4(0.0);
        for (var i = local; i < shape.nodes; i += 256u) {
            let a = at_node(p.member, i);
            solving[a] += alpha * solving[way + a];
            let r = solving[rest + a].xyz - alpha * solving[image + a].xyz;
            solving[rest + a] = vec4(r, 0.0);
            left.x += dot(r, scaled(at_node(p.home, i), r));
        }
        let rz = total(local, left).x;
        let beta = rz / n.rz;
        n.rz = rz;
        if !(sqrt(max(rz, 0.0)) > n.goal) || n.cg >= shape.most {
            ended = true;
            break;
        }
        for (var i = local; i < shape.nodes; i += 256u) {
            let a = at_node(p.member, i);
            solving[way + a] = vec4(scaled(at_node(p.home, i), solving[rest + a].xyz), 0.0) + beta * solving[way + a];
        }
    }
    leave_cg(local, p.member, n, negative, ended, call.extra == FOR_DERIVATIVE);
}
