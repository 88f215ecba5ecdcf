//! Judges a trial of the line search: takes it where it halves the residual or lowers the potential enough (Armijo 1966), else
//! halves the step. A full step at whose end the potential still falls steeply is doubled as long as that lowers the potential: directions that
//! conjugate gradients cut short at a negative curvature are far too short. A trial where the material does not exist is never taken: the step is halved, and
//! of a guess half the way from the old state that is left. call.extra: the round of Newton's method.
// use shared/grid
// use shared/hyper
// use shared/finite
// use shared/sum_nodes
// use shared/efforts

var<storage, read_write> newton: array<Newton>;

// A step shorter than this is taken whatever it brings.
const MOST_TRIALS = 12u;
// Accuracy of a direction far from the solution.
const COARSEST = 0.1;
// Part of the slope at the beginning of a step that is left at its end where the step is too short: a direction that is right leaves none, one
// from a solve that is as coarse as it may be a tenth.
const STEEP = 0.5;
// A step that leaves more than this part of the residual is followed by one with the majorised tangent, as in newton.rs.
const KINKED = 0.5;
// The longest step, over a full one.
const FARTHEST = 1024.0;

@compute @workgroup_size(256)
fn judge_trial(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    var n = newton[p.member];
    workgroupBarrier();
    let first = n.length == 0.0;
    if local == 0u && call.mode != 0u {
        log_effort(call.step, ROUNDS_AT, call.extra + 1u);
        // The trial that a solve has just made ready: so much it took.
        if n.length == 1.0 && n.trial == 0u && call.extra <= MOST_ROUNDS {
            log_effort(call.step, SOLVES_AT + call.extra - 1u, n.cg);
        }
    }
    let s = sum_nodes(local, p.member, 0u);
    let after = sqrt(max(s.x, 0.0));
    let outside = s.z >= NOWHERE_FROM;
    var taken = first;
    var farther = false;
    if !first {
        // Close to the solution the change drowns in rounding of the nodes' shares; then the step is as good as any.
        let rounding = 1e-7 * (n.shares + s.z);
        let lower = s.y <= n.potential + 1e-4 * n.length * n.slope + rounding;
        let halved = n.length == 1.0 && after <= 0.5 * n.norm;
        taken = halved || lower || n.trial >= MOST_TRIALS;
        if n.length >= 1.0 && n.trial == 0u && !halved {
            // The change has to be more than rounding, and from the second doubling on more than what the step before brought.
            let falls = s.y < n.potential - rounding;
            taken = select(falls, taken, n.length == 1.0);
            farther = falls && s.w < STEEP * n.slope && n.length < FARTHEST;
        }
        if !(is_finite(s.x) && is_finite(s.y)) {
            taken = n.trial >= MOST_TRIALS;
            farther = false;
        }
    }
    // A full step that no longer halves a residual this small has met rounding: potentials tell nothing there.
    let goal = max(shape.tolerance * n.scale, n.floor);
    let stuck = !first && n.length == 1.0 && n.trial == 0u && after > 0.5 * n.norm && max(after, n.norm) <= 20.0 * goal;
    taken = (taken || stuck) && !outside;
    farther = farther && !outside && !stuck;
    if farther {
        // What was reached is what the next trial is compared with.
        n.potential = s.y;
        n.shares = s.z;
        n.length *= 2.0;
        taken = false;
    } else if !taken {
        // Back from a doubling to where it began is not asked again.
        n.trial = select(n.trial + 1u, MOST_TRIALS, n.length > 1.0);
        n.length *= 0.5;
    } else {
        n.potential = s.y;
        n.shares = s.z;
        n.stage = WANTS_MATRIX;
        if !first {
            n.iteration += 1u;
            n.convex = 0u;
            let ratio = after / n.norm;
            // As accurate as the next step's quadratic model is (Eisenstat & Walker 1996, choice 2).
            n.forcing = clamp(0.9 * ratio * ratio, 1e-3, COARSEST);
            // What a residual means is its energy, rᵀ A⁻¹ r. Of the residual before, the step tells it: minus the slope. Smooth residuals have many
            // times what block-Jacobi sees of them. That of a small rest is taken to be as smooth.
            let smoothness = max(sqrt(max(-n.slope, 0.0)) / n.norm, 1.0);
            if smoothness * after <= goal || stuck {
                n.stage = IDLE;
            }
            // A step that leaves most of the residual has passed a kink of some dissipation, and so would the next, back again.
            n.majorised = select(0u, 1u, n.majorised == 0u && after > KINKED * n.norm && n.stage != IDLE);
            n.norm = after;
        }
    }
    if local == 0u {
        newton[p.member] = n;
    }
}
