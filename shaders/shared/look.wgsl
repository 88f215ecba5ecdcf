//! A look: one frame, seen by one member at its place inside a step. Looks that are worked on together have slots one after the
//! other in every scratch buffer; a round holds at most one look of a member, so that nothing is added to twice.
// use shared/structs

struct Sight { // mirrored
    // Members B of the batch, simulation nodes N, those with the band's.
    members: u32,
    nodes: u32,
    extended: u32,
    // Band cells.
    cells: u32,
    // Looks that scratch buffers hold.
    slots: u32,
    // Most points and most rows of a frame.
    points: u32,
    rows: u32,
    // Most markers of a frame.
    markers: u32,
    // A cell's candidates are dealt out to so many groups of eight lanes.
    stripes: u32,
    // Most marker sites and most frames of a recording.
    sites: u32,
    frames: u32,
    // Parameters P.
    parameters: u32,
    // Lattice nodes.
    lattice: vec3<u32>,
    // Parameters that are offsets of markers.
    offsets: u32,
    // Edge of a cell [m].
    h: f32,
    // Half width of the cost's band [m].
    band: f32,
    // Cosine beyond which a side is turned away.
    turned_away: f32,
    // Numbers that move depth readings.
    readings: u32,
}

struct Look { // mirrored
    member: u32,
    frame: u32,
    // Which shot: the frame's, or the member's own where effects move its readings.
    shot: u32,
    pad: u32,
    // Factors of u₀, v₀, u₁, v₁, and their derivatives by time.
    value: vec4<f32>,
    rate: vec4<f32>,
    // 1/(n σ²) of depth points, markers, tracked points and displacements [1/m²].
    weights: vec4<f32>,
}

struct Shot { // mirrored
    point_start: u32,
    point_count: u32,
    marker_start: u32,
    marker_count: u32,
    node_start: u32,
    node_count: u32,
    cube_start: u32,
    pad: u32,
    cubes: vec3<u32>,
    pad_cubes: u32,
    // Lowest corner of the cubes, from the frame's origin [m].
    low: vec3<f32>,
    inverse_edge: f32,
    // Frame's origin minus the body's [m]: a float, and what it leaves.
    shift: vec4<f32>,
    shift_rest: vec4<f32>,
    // First entries of `mark_rows`, of its recording's sites, and of the recording's rows of sites at nodes.
    mark_start: u32,
    first_site: u32,
    node_rows: u32,
    // How far a hidden point looks towards the camera beside its distance [m].
    reach: f32,
}

var<uniform> sight: Sight;
var<storage, read> looks: array<Look>;
var<shots> shots: array<Shot>;
var<storage, read> health: array<Health>;

// The same for all invocations of a workgroup, which is what barriers after a look at it need.
struct Seat {
    slot: u32,
    group: u32,
    // Item of the first invocation.
    first: u32,
    look: Look,
    runs: bool,
}

// Arguments of the call: `step` looks from number `extra` on, `roster` workgroups each.
fn find_seat(group: vec3<u32>, groups: vec3<u32>, width: u32) -> Seat {
    let flat = group.x + group.y * groups.x;
    var s: Seat;
    s.slot = flat / call.roster;
    s.group = flat % call.roster;
    s.first = s.group * width;
    s.look = looks[call.extra + min(s.slot, call.step - 1u)];
    s.runs = s.slot < call.step && health[s.look.member].code == WELL;
    return s;
}

// Rows of a frame: one a point, three a marker, three an observed node.
fn rows_of(shot: Shot) -> u32 {
    return shot.point_count + 3u * (shot.marker_count + shot.node_count);
}
