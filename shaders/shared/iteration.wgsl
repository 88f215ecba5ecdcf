//! Scalars of conjugate gradients that many workgroups of a member share. Every workgroup sums the parts again in the same order, so
//! all of them see the same numbers and take the same decisions. call.extra: ODD and WIDE_PARTS.
// use shared/asks
// use shared/solving

// Of each column of a solve, in the first component but where four are told:
// - four scalars of even and of odd iterations (rᵀ M⁻¹ r, iterations so far, 0 going on | 1 ended | 2 negative curvature, 0), then of even and odd
//   updates (1 if the curvature was not positive, 0, 0, 0);
// - by groups of NARROW nodes: parts of pᵀ A p, parts of rᵀ M⁻¹ r.
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

// Sum of the parts that groups of `width` nodes left.
fn sum_parts(local: u32, member: u32, which: u32, width: u32) -> f32 {
    let start = parts_at(member, which);
    let count = groups_of_nodes(width);
    var sum = vec4(0.0);
    for (var i = local; i < count; i += 256u) {
        sum.x += cg_sums[start + i].x;
    }
    return total(local, sum).x;
}
