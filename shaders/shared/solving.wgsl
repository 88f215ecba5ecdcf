//! Vectors of a solve, in one buffer `solving`: four parts, each a vector a node of every system, which is a member or a column of one. The
//! solution comes first. And where the sums of a solve lie in `cg_sums` (`shared/iteration`).
// use shared/roster

// The residual, the way of the iteration, its image A p.
const REST = 1u;
const ALONG_WAY = 2u;
const IMAGE = 3u;

// Where a part starts.
fn solving_part(which: u32) -> u32 {
    return which * (arrayLength(&solving) / 4u);
}

fn along_way(a: u32) -> vec3<f32> {
    return solving[solving_part(ALONG_WAY) + a].xyz;
}

fn groups_of_nodes(width: u32) -> u32 {
    return (shape.nodes + width - 1u) / width;
}

// Where the scalars of a member start.
fn scalars_at(member: u32) -> u32 {
    return member * (4u + 2u * groups_of_nodes(NARROW));
}

// Where the parts of a member start: 0 = pᵀ A p, 1 = rᵀ M⁻¹ r.
fn parts_at(member: u32, which: u32) -> u32 {
    return scalars_at(member) + 4u + which * groups_of_nodes(NARROW);
}
