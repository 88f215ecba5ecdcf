//! Structs that host and kernels share (twins in crates/palpate-gpu/src/layout.rs), and the numbers of stages and failures.

struct Call { // mirrored
    step: u32,
    mode: u32,
    roster: u32,
    extra: u32,
}
var<immediate> call: Call;

struct Shape { // mirrored
    members: u32,
    nodes: u32,
    cells: u32,
    blocks: u32,
    patches: u32,
    holds: u32,
    clamps: u32,
    planes: u32,
    masses: u32,
    parameters: u32,
    classes: u32,
    steps: u32,
    h: f32,
    dt: f32,
    theta: f32,
    world: f32,
    pivot: vec3<f32>,
    tolerance: f32,
    iterations: u32,
    chunk: u32,
    most: u32,
    quantum: f32,
    ghosts: u32,
    fields: u32,
    time: f32,
    contact_width: f32,
    aging_rows: u32,
    point_items: u32,
    rate_numbers: u32,
    rate_effects: u32,
    first_patch: u32,
    first_mass: u32,
    elastic: u32,
    held: u32,
    element_size: f32,
    // Elements, cells or tetrahedra, and elastic points of each tetrahedron.
    elements: u32,
    per_element: u32,
    // Groups of nodes on the second level of the preconditioner, the stages' kind there, and the edge of groups [m].
    groups: u32,
    coarse_kind: u32,
    group_size: f32,
    // Slices of them that products are made in.
    slices: u32,
    // Workgroups that a system's solve is given for a whole dispatch; 0: none stays.
    crew: u32,
    // Things beside the body that a file moves, and the edge of a mean patch [m].
    obstacles: u32,
    jets: u32,
    patch_size: f32,
    // Rows of sums of their numbers.
    moving_rows: u32,
}

struct Member { // mirrored
    young: f32,
    density: f32,
    mass_damping: f32,
    stiffness_damping: f32,
    ghost: vec2<f32>,
    slot: u32,
    start: f32,
    gravity: vec4<f32>,
    velocity: vec4<f32>,
    spin: vec4<f32>,
    // λ/E and μ/E, and their derivatives by ν.
    lame: vec4<f32>,
    // Viscosity: coefficient and exponent, and the slot of the element matrices at ν = 0.
    flow: vec4<f32>,
}

struct Plane { // mirrored
    normal: vec4<f32>,
    by_theta: vec4<f32>,
    by_phi: vec4<f32>,
    stiffness: f32,
    scales: f32,
    pad: vec2<f32>,
}

struct Cell { // mirrored
    nodes: array<u32, 8>,
    kind: u32,
    patch_start: u32,
    patch_end: u32,
    hold_start: u32,
    hold_end: u32,
    fraction: f32,
    whole: f32,
    pad: u32,
}

struct ClampPose { // mirrored
    turn: mat3x3<f32>,
    excess: mat3x3<f32>,
    shift: vec4<f32>,
    turn_rate: mat3x3<f32>,
    shift_rate: vec4<f32>,
}

struct HoldSlope { // mirrored
    turn: mat3x3<f32>,
    shift: vec4<f32>,
}

// Bits of `Shape.fields`: effects vary the stiffness over the body, the density; act on patches; vary the stiffness in time; change the
// stress-free shape, and the body starts in it; act on clamps. The last: what patches do depends on the old state.
const FIELD_MODULUS = 1u;
const FIELD_DENSITY = 2u;
const FIELD_PATCHES = 4u;
const FIELD_AGING = 8u;
const FIELD_REST = 16u;
const FIELD_STARTS = 32u;
const FIELD_GRIPS = 64u;
const FIELD_COUPLED = 128u;
// From this bit on the number of scalars that laws of cells depend on, and from that bit on how many such laws there are.
const SCALARS_AT = 8u;
const MOST_SCALARS = 15u;
const LAWS_AT = 12u;
const MOST_COUNT = 255u;
// From this bit on the number of the material, 0 where it is linear.
const MATERIAL_AT = 20u;
const MOST_MATERIALS = 255u;
// A body of stars, which have a residual penalty and bear their own mass alone.
const FIELD_STARS = 0x10000000u;
// Some stages start from several states; this one does: `now` is their weighted sum.
const FIELD_MIXES = 0x40000000u;
const FIELD_SEVERAL = 0x80000000u;

// Vectors that tangent_cells keeps of a cell.
const TANGENT_VECTORS = 30u;

// In place of a number: there is none.
const NONE = 0xffffffffu;

const IDLE = 0u;
const WANTS_MATRIX = 1u;
const WANTS_SOLVE = 2u;
const WANTS_TRIAL = 3u;

struct Newton { // mirrored
    stage: u32,
    convex: u32,
    majorised: u32,
    iteration: u32,
    trial: u32,
    norm: f32,
    scale: f32,
    forcing: f32,
    goal: f32,
    length: f32,
    potential: f32,
    shares: f32,
    slope: f32,
    rz: f32,
    cg: u32,
    total: u32,
    floor: f32,
}

const WELL = 0u;
const NOT_FINITE = 1u;
const STALLED = 2u;
const UNSOLVED = 3u;
const INDEFINITE = 4u;
const FELL_OUT = 5u;
const BAD_PARAMETER = 6u;
const NO_CLAMP = 7u;
// Cut off before it had all the iterations that it is allowed.
const HURRIED = 8u;
// Well, but the recording that it is compared with takes no more steps.
const RESTING = 9u;
// Workgroups that had to run at the same time did not.
const STRANDED = 10u;

struct Health { // mirrored
    code: u32,
    step: u32,
    detail: vec2<f32>,
}
