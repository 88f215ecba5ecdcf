//! Scalars of conjugate gradients that many workgroups of a member share. Every workgroup sums the parts again in the same order, so
//! all of them see the same numbers and take the same decisions. call.extra: ODD and WIDE_PARTS.
// use shared/asks
// use shared/roster

// Of each column of a solve [4]: of even and of odd iterations (rᵀ M⁻¹ r, iterations so far, 0 going on | 1 ended | 2 negative curvature, 0), then of even
// and odd updates (1 if the curvature was not positive, 0, 0, 0).
var<storage, read_write> cg_scalars: array<vec4<f32>>;
// Of each column [2][groups of NARROW nodes]: parts of pᵀ A p, parts of rᵀ M⁻¹ r.
var<storage, read_write> cg_parts: array<f32>;

fn groups_of_nodes(width: u32) -> u32 {
    return (shape.nodes + width - 1u) / width;
}

// Where the parts of a member start: 0 = pᵀ A p, 1 = rᵀ M⁻¹ r.
fn parts_at(member: u32, which: u32) -> u32 {
    return (2u * member + which) * groups_of_nodes(NARROW);
}

// Width of the groups that products were made in.
fn product_width() -> u32 {
    return select(NARROW, WIDE, (call.extra & WIDE_PARTS) != 0u);
}

fn parity() -> u32 {
    return call.extra & ODD;
}

// Sum of the parts that groups of `width` nodes left.
fn sum_parts(local: u32, member: u32, which: u32, width: u32) -> f32 {
    let start = parts_at(member, which);
    let count = groups_of_nodes(width);
    var sum = vec4(0.0);
    for (var i = local; i < count; i += 256u) {
        sum.x += cg_parts[start + i];
    }
    return total(local, sum).x;
}
