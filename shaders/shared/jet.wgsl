//! A jet's force on a patch, with its derivatives. Twin of palpate-model/src/effects/jet.rs and mechanics/normal.rs.
// use shared/moving
// use shared/patches

struct Jet { // mirrored
    // Unit vector that it blows along, in the nozzle's coordinates.
    axis: vec3<f32>,
    // Its first number among those of all effects, how many of these a member has, and its first row of sums.
    value: u32,
    stride: u32,
    row: u32,
    pad: vec2<u32>,
}

var<body> jets: array<Jet>;
// Normal of every patch at rest.
var<body> patch_normals: array<vec4<f32>>;
// How the body deforms at a patch: where its entries start, their nodes, weights of the gradient [1/m].
var<body> frame_rows: array<u32>;
var<body> frame_nodes: array<u32>;
var<body> frame_gradients: array<vec4<f32>>;
var<storage, read> now: array<vec4<f32>>;

// What a jet's force on a patch depends on: the way there from the virtual origin [m], the patch's area vector [m²], the axis, thrust and spread.
struct Meeting {
    way: vec3<f32>,
    area: vec3<f32>,
    axis: vec3<f32>,
    thrust: f32,
    spread: f32,
}

struct Blown {
    at: Meeting,
    // Whether there is a force.
    feels: bool,
    // Dynamic pressure times two, and the force, for a thrust of 1 N.
    pressure: f32,
    unit: vec3<f32>,
    // Place along the axis, and the jet's radius there [m].
    s: f32,
    b: f32,
    // axis · area.
    through: f32,
}

fn blow(at: Meeting) -> Blown {
    var f: Blown;
    f.at = at;
    f.s = dot(at.way, at.axis);
    f.through = dot(at.axis, at.area);
    f.feels = f.s > 0.0 && f.through < 0.0;
    if f.feels {
        f.b = at.spread * f.s;
        let beside = at.way - f.s * at.axis;
        f.pressure = 2.0 / (3.14159265 * f.b * f.b) * exp(-2.0 * dot(beside, beside) / (f.b * f.b));
        f.unit = -f.pressure * (f.through * f.through / dot(at.area, at.area)) * at.area;
    }
    return f;
}

// Derivatives of the logarithm of the pressure by way and axis; by the spread they are the last.
struct Slopes {
    way: vec3<f32>,
    axis: vec3<f32>,
    spread: f32,
}

fn slopes_of(f: Blown) -> Slopes {
    let beside = f.at.way - f.s * f.at.axis;
    let by_b = -2.0 / f.b + 4.0 * dot(beside, beside) / (f.b * f.b * f.b);
    let by_s = by_b * f.at.spread + 4.0 * f.s / (f.b * f.b);
    return Slopes(f.at.axis * by_s - f.at.way * (4.0 / (f.b * f.b)), f.at.way * by_s, by_b * f.s);
}

// Change of the force for a change of what it depends on.
fn blown_along(f: Blown, d: Meeting) -> vec3<f32> {
    let by = slopes_of(f);
    let area = f.at.area;
    let size = dot(area, area);
    let louder = dot(by.way, d.way) + dot(by.axis, d.axis) + by.spread * d.spread;
    let through = dot(d.axis, area) + dot(f.at.axis, d.area);
    let turned = (2.0 * f.through * through - 2.0 * f.through * f.through * dot(area, d.area) / size) / size;
    let bent = turned * area + (f.through * f.through / size) * d.area;
    return (f.at.thrust * louder + d.thrust) * f.unit - (f.at.thrust * f.pressure) * bent;
}

// Its transpose, for a derivative w by the force.
fn blown_pull(f: Blown, w: vec3<f32>) -> Meeting {
    let by = slopes_of(f);
    let area = f.at.area;
    let size = dot(area, area);
    let t = f.through;
    let pressure = f.at.thrust * f.pressure;
    let work = f.at.thrust * dot(w, f.unit);
    let turned = -pressure * dot(w, area) / size;
    return Meeting(
        work * by.way,
        turned * (2.0 * t * f.at.axis - (2.0 * t * t / size) * area) - (pressure * t * t / size) * w,
        work * by.axis + (turned * 2.0 * t) * area,
        dot(w, f.unit),
        work * by.spread,
    );
}

// Area vector of a unit of surface with the normal n at rest, its change for a change of F, and the transpose of that.
fn carried(n: vec3<f32>, f: mat3x3<f32>) -> vec3<f32> {
    return n.x * cross(f[1], f[2]) + n.y * cross(f[2], f[0]) + n.z * cross(f[0], f[1]);
}

fn carried_along(n: vec3<f32>, f: mat3x3<f32>, d: mat3x3<f32>) -> vec3<f32> {
    return n.x * (cross(d[1], f[2]) + cross(f[1], d[2]))
        + n.y * (cross(d[2], f[0]) + cross(f[2], d[0]))
        + n.z * (cross(d[0], f[1]) + cross(f[0], d[1]));
}

fn carried_pull(n: vec3<f32>, f: mat3x3<f32>, g: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(
        n.y * cross(g, f[2]) + n.z * cross(f[1], g),
        n.z * cross(g, f[0]) + n.x * cross(f[2], g),
        n.x * cross(g, f[1]) + n.y * cross(f[0], g),
    );
}

// F at a patch in the old state.
fn frame_of(member: u32, which: u32) -> mat3x3<f32> {
    // From the first node: what all have in common costs no digits.
    let o = at_node(member, frame_nodes[frame_rows[which]]);
    var f = mat3x3(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
    for (var k = frame_rows[which]; k < frame_rows[which + 1u]; k++) {
        let a = at_node(member, frame_nodes[k]);
        let u = (now[a].xyz - now[o].xyz) + (now[part(1u) + a].xyz - now[part(1u) + o].xyz);
        let g = frame_gradients[k].xyz;
        f += mat3x3(u * g.x, u * g.y, u * g.z);
    }
    return f;
}

// Displacement of a patch in the old state, and what is added to its place, which is large, first.
fn way_to(member: u32, which: u32, away: vec3<f32>) -> vec3<f32> {
    let stencil = patch_stencil(which);
    var whole = away;
    var rest = vec3(0.0);
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        let a = at_node(member, stencil_entries[k].node);
        whole += stencil_entries[k].weight * now[a].xyz;
        rest += stencil_entries[k].weight * now[part(1u) + a].xyz;
    }
    return whole + rest;
}

fn jet_pose(member: u32, number: u32) -> MovingPose {
    return moving_pose(member, 0u, shape.obstacles + number);
}

// What jet `number` meets at a patch.
fn meeting(number: u32, member: u32, which: u32, f: mat3x3<f32>) -> Meeting {
    let jet = jets[number];
    let pose = jet_pose(member, number);
    let site = patches[which];
    let values = member * jet.stride + jet.value;
    return Meeting(
        way_to(member, which, site.xyz - pose.shift.xyz),
        site.w * carried(patch_normals[which].xyz, f),
        pose.turn * jet.axis,
        effect_values[values],
        effect_values[values + 1u],
    );
}

// What it meets for a change of its numbers or for a later time.
fn meets_later(number: u32, pose: MovingPose) -> Meeting {
    return Meeting(-pose.shift_rate.xyz, vec3(0.0), pose.turn_rate * jets[number].axis, 0.0, 0.0);
}

// Where [jets][B][patches] has a patch.
fn jet_at(number: u32, member: u32, which: u32) -> u32 {
    return (number * shape.members + member) * shape.patches + which;
}
