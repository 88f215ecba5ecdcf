//! Scalars of conjugate gradients that many workgroups of a system share. Every workgroup sums the parts again in the same order, so
//! all of them see the same numbers and take the same decisions. call.extra: ODD and WIDE_PARTS. Who asks has sums over a workgroup
//! (`shared/totals`).
// use shared/asks
// use shared/finite
// use shared/solving

// Of each system, in the first component but where four are told:
// - four scalars of even and of odd iterations (rᵀ M⁻¹ r, iterations so far, 0 going on | 1 ended | 2 negative curvature, rᵀ M⁻¹ r of the right-hand
//   side), then of even and odd updates (1 if the curvature was not positive, xᵀ times the right-hand side, 0, 0);
// - by groups of NARROW nodes: parts of pᵀ A p; by groups of the second level: parts of rᵀ M⁻¹ r, then force and torque, then shift
//   and turn.
var<storage, read_write> cg_sums: array<vec4<f32>>;
var<workgroup> common_scalars: vec4<f32>;

// Scalars at a place, read once for a workgroup: who reads what others may write does not know that all of it sees the same.
fn scalars_of(local: u32, place: u32) -> vec4<f32> {
    if local == 0u {
        common_scalars = cg_sums[place];
    }
    return workgroupUniformLoad(&common_scalars);
}

// Width of the groups that products were made in.
fn product_width() -> u32 {
    return select(NARROW, WIDE, (call.extra & WIDE_PARTS) != 0u);
}

fn parity() -> u32 {
    return call.extra & ODD;
}

// Sum of so many parts.
fn sum_parts(local: u32, start: u32, count: u32) -> f32 {
    var sum = vec4(0.0);
    for (var i = local; i < count; i += TEAM) {
        sum.x += cg_sums[start + i].x;
    }
    return total(local, sum).x;
}

// Whether a residual is as small as a solve wants it, by itself or relative to the right-hand side's, or nothing that a solve could go on with.
// A direction's has a goal by itself, told in the norm of block-Jacobi, which is the smaller one: what Newton's method sees falls as much.
fn is_small(rz: f32, of_rhs: f32, n: Newton) -> bool {
    let goal = select(n.forcing * sqrt(max(of_rhs, 0.0)), n.goal, n.goal > 0.0);
    return !is_finite(rz) || sqrt(max(rz, 0.0)) <= goal;
}

// β of an iteration from its scalars and those of the one before; before the first one nothing came.
fn way_factor_of(now: vec4<f32>, before: vec4<f32>) -> f32 {
    if before.y == 0.0 {
        return 0.0;
    }
    return now.x / before.x;
}
