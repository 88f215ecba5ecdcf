//! Vectors of a solve by conjugate gradients, in one buffer `solving`: six parts, each a vector a node of every system, which is a member or a
//! column of one. The solution comes first. And where the sums of a solve lie in `cg_sums` (`shared/iteration`).
// use shared/roster

// The residual; the way p of even and of odd iterations; the image A p; the preconditioned residual z.
const REST = 1u;
const EVEN_WAY = 2u;
const ODD_WAY = 3u;
const IMAGE = 4u;
const SCALED = 5u;
const PARTS_OF_SOLVING = 6u;

// What makes the way of an iteration of the one before: z + β p. Whoever asks for the way has set it, and where the one
// before lies and this one goes.
var<private> way_factor: f32;
var<private> way_before: u32;
var<private> way_at: u32;

// Where a part starts.
fn solving_part(which: u32) -> u32 {
    return which * (arrayLength(&solving) / PARTS_OF_SOLVING);
}

// Says which iteration is asked for its way.
fn set_way(odd: u32, factor: f32) {
    way_factor = factor;
    way_before = solving_part(select(ODD_WAY, EVEN_WAY, odd == 1u));
    way_at = solving_part(select(EVEN_WAY, ODD_WAY, odd == 1u));
}

// Where the way of the iteration is kept, for the next one.
fn way_now() -> u32 {
    return way_at;
}

// The way of the iteration, made where it is needed: so no dispatch has to come before a product.
fn along_way(a: u32) -> vec3<f32> {
    return solving[solving_part(SCALED) + a].xyz + way_factor * solving[way_before + a].xyz;
}

fn groups_of_nodes(width: u32) -> u32 {
    return (shape.nodes + width - 1u) / width;
}

// Where the scalars of a system start.
fn scalars_at(system: u32) -> u32 {
    return system * (4u + groups_of_nodes(NARROW) + 5u * shape.groups);
}

// Where parts of pᵀ A p start, one for some nodes.
fn bends_at(system: u32) -> u32 {
    return scalars_at(system) + 4u;
}

// Where parts of rᵀ M⁻¹ r start, one a group.
fn rests_at(system: u32) -> u32 {
    return bends_at(system) + groups_of_nodes(NARROW);
}

// Where force and torque of the residual on every group start.
fn wrenches_at(system: u32) -> u32 {
    return rests_at(system) + shape.groups;
}

// Where their motions start, where one workgroup makes them.
fn motions_at(system: u32) -> u32 {
    return wrenches_at(system) + 2u * shape.groups;
}
