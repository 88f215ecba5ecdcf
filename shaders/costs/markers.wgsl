//! Markers: carried rigidly by the surface point that they are attached to, also on a stalk. Twin of
//! palpate-cpu/src/costs/markers.rs. The stencils of these passes are the sites.
// use shared/seen
// use shared/rotation
// use shared/stencil

struct Site { // mirrored
    // From the attachment point to the marker's centre at rest [m].
    stalk: vec3<f32>,
    // 1 of a tracked point.
    track: u32,
    // Deformation gradient at rest, minus the identity.
    excess: mat3x3<f32>,
}

struct Mark { // mirrored
    // Measured minus rest position [m], and what single precision leaves of it.
    goal: vec3<f32>,
    // Counted in its recording.
    site: u32,
    goal_rest: vec3<f32>,
    pad: u32,
}

// A marker at one look.
struct Carried { // mirrored
    turn: mat3x3<f32>,
    // G⁻¹ of the polar decomposition.
    pair: mat3x3<f32>,
    // dJ/d(position), and w of the gradient by F = R [w]×.
    pull: vec4<f32>,
    spin: vec4<f32>,
}

var<body> sites: array<Site>;
// [B][most sites]: how far markers sit off the places that the recording states, on the rest shape [m].
var<storage, read> offsets: array<vec4<f32>>;
var<body> marks: array<Mark>;
// [slots][most markers]
var<storage, read_write> carried: array<Carried>;

// From the attachment point to the centre of a member's marker, at rest; its recording's sites begin at `first`.
fn stalk_of(member: u32, first: u32, site: u32) -> vec3<f32> {
    return sites[first + site].stalk + offsets[member * sight.sites + site].xyz;
}

// 1/(n σ²) of what is read of a site [1/m²].
fn site_weight(look: Look, site: Site) -> f32 {
    return select(look.weights.y, look.weights.z, site.track == 1u);
}

// The marker with what a residual pulls at it.
fn pulled(carrier: Carried, r: vec3<f32>, look: Look, first: u32, site: u32) -> Carried {
    var c = carrier;
    let pull = site_weight(look, sites[first + site]) * r;
    c.pull = vec4(pull, 0.0);
    c.spin = vec4(c.pair * cross(stalk_of(look.member, first, site), transpose(c.turn) * pull), 0.0);
    return c;
}
