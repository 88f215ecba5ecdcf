//! Decides, for each member with a fresh matrix, whether its Newton solve is done, and prepares conjugate gradients otherwise.
//! The residual is measured with the inverse diagonal blocks, against the sizes of the forces that it is the sum of.
// use shared/grid
// use shared/finite
// use shared/sum_nodes
// use shared/newton_of

var<storage, read_write> health: array<Health>;

@compute @workgroup_size(256)
fn begin_solve(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    let f = sqrt(max(sum_nodes(local, p.member, 0u), vec4(0.0)));
    let s = sum_nodes(local, p.member, 1u);
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
}
