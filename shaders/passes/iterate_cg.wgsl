//! A bounded number of conjugate-gradient iterations, one workgroup per member and column; every scalar stays on the device. Ends in the
//! norm sqrt(rᵀ M⁻¹ r), to which a nearly massless node counts as much as any other. call.extra: FOR_DIRECTION or
//! FOR_DERIVATIVE.
// use shared/asks
// use shared/mix
// use shared/product
// use shared/totals
// use shared/precondition
// use shared/leave_cg

var<storage, read> block_rows: array<u32>;
var<storage, read> columns: array<u32>;
var<storage, read> values: array<f32>;
var<storage, read_write> cg_rest: array<vec4<f32>>;
var<storage, read_write> cg_along: array<vec4<f32>>;
var<storage, read_write> cg_image: array<vec4<f32>>;

@compute @workgroup_size(256)
fn iterate_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    let m = members[p.home];
    let mix = mix_of(m);
    var n = newton[p.member];
    workgroupBarrier();
    if n.stage != WANTS_SOLVE {
        return;
    }
    var ended = false;
    var negative = false;
    for (var iteration = 0u; iteration < shape.chunk; iteration++) {
        storageBarrier();
        var curvature = vec4(0.0);
        for (var i = local; i < shape.nodes; i += 256u) {
            var q = vec3(0.0);
            if !has_mass_matrix() {
                q = (mix.inertia * node_mass(m, p.home, i)) * cg_along[at_node(p.member, i)].xyz;
            }
            for (var k = block_rows[i]; k < block_rows[i + 1u]; k++) {
                let x = cg_along[at_node(p.member, columns[k])].xyz;
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
            cg_image[a] = vec4(q, 0.0);
            curvature.x += dot(cg_along[a].xyz, q);
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
            direction[a] += alpha * cg_along[a];
            let r = cg_rest[a].xyz - alpha * cg_image[a].xyz;
            cg_rest[a] = vec4(r, 0.0);
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
            cg_along[a] = vec4(scaled(at_node(p.home, i), cg_rest[a].xyz), 0.0) + beta * cg_along[a];
        }
    }
    leave_cg(local, p.member, n, negative, ended, call.extra == FOR_DERIVATIVE);
}
