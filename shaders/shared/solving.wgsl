//! Vectors of a solve by conjugate gradients, in one buffer `solving`: seven parts, each a vector a node of every system, which is a member or a
//! column of one. The solution comes first. And where the sums of a solve lie in `cg_sums` (`shared/iteration`).
// use shared/roster

// The solution x; the residual r; the way p of even and of odd iterations; its image A p, or in a look at the true residual that of the solution; the
// preconditioned residual z; and the right-hand side, which only derivatives keep.
const SOLUTION = 0u;
const REST = 1u;
const EVEN_WAY = 2u;
const ODD_WAY = 3u;
const IMAGE = 4u;
const SCALED = 5u;
const RIGHT = 6u;
const PARTS_OF_SOLVING = 7u;

// Sums of a system: its scalars; two vectors a slice of nodes; and seven a group.
const SCALARS = 4u;
const OF_SLICE = 2u;
const OF_GROUP = 7u;

// Where a part starts.
fn solving_part(which: u32) -> u32 {
    return which * (arrayLength(&solving) / PARTS_OF_SOLVING);
}

// Where the scalars of a system start.
fn scalars_at(system: u32) -> u32 {
    return system * (SCALARS + OF_SLICE * shape.slices + OF_GROUP * shape.groups);
}

// Where what a product left of each slice starts: the force of its rows on their group, with their part of pᵀ A p; and the torque.
fn slices_at(system: u32) -> u32 {
    return scalars_at(system) + SCALARS;
}

// Where parts of rᵀ M⁻¹ r start, one a group.
fn rests_at(system: u32) -> u32 {
    return slices_at(system) + OF_SLICE * shape.slices;
}

// Where force and torque on every group start that the residual is, after an even or an odd iteration.
fn wrenches_at(system: u32, odd: u32) -> u32 {
    return rests_at(system) + (1u + 2u * odd) * shape.groups;
}

// Where the groups' motions start, where one workgroup makes them.
fn motions_at(system: u32) -> u32 {
    return wrenches_at(system, 2u);
}
