//! Scalars of conjugate gradients that many workgroups of a system share. Every workgroup sums the parts again in the same order, so
//! all of them see the same numbers and take the same decisions. Who asks has sums over a workgroup (`shared/totals`), and says by `parity()` whether
//! the iteration is an odd one.
// use shared/asks
// use shared/finite
// use shared/solving

// Of each system: four scalars of even and of odd iterations (rᵀ z, iterations so far, 0 going on | 1 ended | 2 negative curvature | 3 given up, rᵀ z of the
// right-hand side), then of even and odd updates (1 if the curvature was not positive, xᵀ times the right-hand side, 0, 0); what else there is says
// `shared/solving`.
var<storage, read_write> cg_sums: array<vec4<f32>>;
// In place of what the scalars say of an end: workgroups that had to meet have not (`shared/meeting`).
const ALONE = 3.0;

// Squares of residuals that single precision has no digits for: terms of their sums underflow. Loads that are nothing but rounding end there.
const NOTHING = 1e-34;

var<workgroup> common_scalars: vec4<f32>;

// Scalars at a place, read once for a workgroup: who reads what others may write does not know that all of it sees the same.
fn scalars_of(local: u32, place: u32) -> vec4<f32> {
    if local == 0u {
        common_scalars = cg_sums[place];
    }
    return workgroupUniformLoad(&common_scalars);
}

// Sums of the residual from the groups' parts: rᵀ z, rᵀ D⁻¹ r, and what of that nodes have which stiff springs hold.
fn sum_rests(local: u32, system: u32) -> vec3<f32> {
    var sum = vec4(0.0);
    for (var i = local; i < shape.groups; i += TEAM) {
        sum += cg_sums[rests_at(system) + i];
    }
    return total(local, sum).xyz;
}

// The square of a residual's size, from its sums. rᵀ z is the larger one as long as the second level is positive. Were it not, no residual would
// seem small that the nodes' own blocks call large.
fn square_of(rests: vec3<f32>) -> f32 {
    return max(max(rests.x, rests.y), 0.0);
}

// Whether a residual is as small as a solve wants it, by itself or relative to the right-hand side's, or nothing that a solve could go on with.
// A direction's has a goal by itself, told in the norm of block-Jacobi, which is the smaller one: what Newton's method sees falls as much.
fn is_small(rests: vec3<f32>, of_rhs: f32, n: Newton) -> bool {
    return is_within(1.0, rests, of_rhs, n);
}

// Whether it is so many times as large, or smaller.
fn is_within(times: f32, rests: vec3<f32>, of_rhs: f32, n: Newton) -> bool {
    let goal = select(n.forcing * sqrt(max(of_rhs, 0.0)), n.goal, n.goal > 0.0);
    return !is_finite(rests.x) || (goal >= 0.0 && square_of(rests) <= NOTHING) || sqrt(square_of(rests)) <= times * goal;
}

// β of an iteration from rᵀ z and that of the one before; before a first one stands nothing, or less.
fn way_factor_of(rz: f32, before: f32) -> f32 {
    if before <= 0.0 {
        return 0.0;
    }
    return rz / before;
}

fn is_curved(curvature: f32) -> bool {
    return curvature > 0.0 && is_finite(curvature);
}
