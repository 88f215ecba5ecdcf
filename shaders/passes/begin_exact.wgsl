//! Prepares conjugate gradients for a derivative: A x = rhs with the exact tangent at a converged state, as column call.extra of
//! every member. What goes wrong with a column is kept for end_exact.
// use shared/grid
// use shared/finite
// use shared/sum_nodes
// use shared/accuracy

var<storage, read_write> newton: array<Newton>;
var<storage, read_write> health: array<Health>;

// Stiffness of a held node's springs over that of its share of the body.
override held_stiffness: f32;

@compute @workgroup_size(256)
fn begin_exact(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_share(group, groups, 1u, 1u);
    if !p.runs {
        return;
    }
    let system = call.extra * shape.members + p.member;
    let s = sum_nodes(local, p.member, 0u);
    var measured = s.x;
    if shape.held != 0u {
        // What stiff springs bear is settled at once. It counts by the load that it becomes on the rest of the body.
        measured = s.z + s.w / held_stiffness;
    }
    if local != 0u {
        return;
    }
    var n = newton[system];
    n.rz = s.x;
    n.norm = sqrt(max(s.x, 0.0));
    n.goal = 0.0;
    n.forcing = FINEST * sqrt(max(measured, 0.0) / max(s.x, 1e-37));
    n.cg = 0u;
    n.trial = 0u;
    n.stage = select(IDLE, WANTS_SOLVE, n.norm > 0.0);
    var broken = WELL;
    if s.y > 0.0 {
        broken = INDEFINITE;
    }
    if !is_finite(s.x) {
        broken = NOT_FINITE;
    }
    if broken != WELL {
        n.stage = IDLE;
    }
    health[system] = Health(broken, call.step + call.mode, vec2(n.norm, 0.0));
    newton[system] = n;
}
