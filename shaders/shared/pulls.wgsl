//! Derivatives of a cost by the coefficients of the balance, −z · ∂r/∂c for all of them in one pass a term. `probe` is z. They are added up over
//! the steps: by item where there is a coefficient an item, else by workgroup, which the host sums.

// Bits of call.extra: what is sought.
const SEEK_MODULUS = 1u;
const SEEK_POISSON = 2u;
const SEEK_DAMPING = 4u;
const SEEK_REST = 8u;
const SEEK_START = 16u;
const SEEK_VISCOSITY = 32u;
// Of clamps, from these bits on: numbers of effects that move their poses, and of those that change their matrices.
const POSES_AT = 8u;
const MATRICES_AT = 20u;
// Of laws of points: the effect in as many bits, then what is sought of it, then its first row of sums.
const SEEK_AT = 8u;
const SEEK_OWN = 1u;
const SEEK_GRAVITY = 2u;
const SEEK_STIFFNESS = 4u;
const SEEK_TIME = 8u;
const SEEK_PLANES = 16u;
const ROW_AT = 13u;
// Rows of the sums over cells and over clamp cells before those of effects' numbers, and numbers of a law of cells.
const CELL_ROWS = 4u;
const HOLD_ROWS = 2u;
// Rows of the sums over held nodes before those of changes in time.
const HELD_ROWS = 3u;
const CELL_SLOTS = 8u;
// Rows of a law of points beside its own numbers: gravity, stiffness, time; and of each plane: height and angles, stiffness.
const POINT_ROWS = 5u;
const PLANE_ROWS = 3u;

var<workgroup> pulled: array<vec4<f32>, 64>;

fn seeks(what: u32) -> bool {
    return (call.extra & what) != 0u;
}

// Sum over a workgroup of 64, in the same order every time. Every lane must call it.
fn sum64(local: u32, v: vec4<f32>) -> vec4<f32> {
    workgroupBarrier();
    pulled[local] = v;
    workgroupBarrier();
    for (var s = 32u; s > 0u; s /= 2u) {
        if local < s {
            pulled[local] += pulled[local + s];
        }
        workgroupBarrier();
    }
    return pulled[0];
}

// Sum over the eight cells of a workgroup, lane by lane, in lanes 0 to 7. Every lane must call it.
fn sum_cells(local: u32, v: f32) -> f32 {
    workgroupBarrier();
    pulled[local] = vec4(v, 0.0, 0.0, 0.0);
    workgroupBarrier();
    var sum = 0.0;
    for (var cell = 0u; cell < 8u; cell++) {
        sum += pulled[8u * cell + local % 8u].x;
    }
    return sum;
}

// Where a row of sums has the part of a member's workgroup, of workgroups over so many items.
fn row_at(row: u32, member: u32, item: u32, items: u32, width: u32) -> u32 {
    let each = (items + width - 1u) / width;
    return (row * shape.members + member) * each + item / width;
}
