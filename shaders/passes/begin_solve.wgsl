//! Decides, for each member with a fresh matrix, whether its Newton solve is done, and prepares conjugate gradients otherwise.
//! The residual is measured with the inverse diagonal blocks, against the sizes of the forces that it is the sum of.
// use shared/mix
// use shared/iteration
// use shared/coarse_alone
// use shared/first_cg
// use shared/newton_of

var<storage, read> now: array<vec4<f32>>;
var<storage, read> residual: array<vec4<f32>>;
var<storage, read_write> solving: array<vec4<f32>>;
var<storage, read_write> health: array<Health>;

@compute @workgroup_size(256)
fn begin_solve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    let m = members[p.member];
    var forces = vec4(0.0);
    var state = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        let r = residual[a].xyz;
        let mass = residual[part(2u) + a].w;
        let weight = mass * m.gravity.xyz;
        var momentum = vec3(0.0);
        if call.mode != 0u {
            momentum = mass * now[part(2u) + a].xyz / (shape.theta * shape.dt);
        }
        let elastic = residual[part(1u) + a].xyz;
        let support = residual[part(2u) + a].xyz;
        forces += vec4(dot(weight, scaled(a, weight)), dot(momentum, scaled(a, momentum)),
                       dot(elastic, scaled(a, elastic)), dot(support, scaled(a, support)));
        let extra = inverses[2u * a + 1u];
        state += vec4(dot(r, scaled(a, r)), extra.w, abs(extra.z), 0.0);
    }
    let f = sqrt(max(total(local, forces), vec4(0.0)));
    let s = total(local, state);
    var n = newton_of(local, p.member);
    var broken = 0u;
    if s.y > 0.0 {
        broken = INDEFINITE;
        if n.convex == 0u {
            // Again, with the convex part of the tangent.
            n.convex = 1u;
            if local == 0u {
                newton[p.member] = n;
            }
            return;
        }
    }
    n.norm = sqrt(max(s.x, 0.0));
    if !is_finite(s.x) {
        broken = NOT_FINITE;
    }
    if n.iteration == 0u {
        n.scale = f.x + f.y + f.z + f.w;
    }
    // Rounding: differences of displacements across an element carry 6e-8 of its size or less; their errors add like a random walk.
    n.floor = 4e-8 * shape.element_size * sqrt(s.z / 3.0);
    if broken == 0u && n.iteration >= shape.iterations {
        broken = STALLED;
    }
    if broken != 0u {
        n.stage = IDLE;
        if local == 0u {
            health[p.member] = Health(broken, call.step + call.mode, vec2(n.norm / n.scale, f32(n.iteration)));
            newton[p.member] = n;
        }
        return;
    }
    // Later ones are judged with their trials.
    if n.iteration == 0u && n.norm <= max(shape.tolerance * n.scale, n.floor) {
        n.stage = IDLE;
        if local == 0u {
            newton[p.member] = n;
        }
        return;
    }
    n.stage = WANTS_SOLVE;
    n.goal = max(n.forcing * n.norm, 0.1 * shape.tolerance * n.scale);
    n.rz = n.norm * n.norm;
    n.cg = 0u;
    n.trial = 0u;
    if local == 0u {
        newton[p.member] = n;
    }
    for (var i = local; i < shape.nodes; i += 256u) {
        begin_at(at_node(p.member, i), -residual[at_node(p.member, i)].xyz);
    }
    first_cg(local, p.member);
    restrict_alone(local, p.member, p.member);
}
