//! A frame's points and the places of a surface, from a common centre: what the passes of tracking are asked about, and the keys that they are
//! sorted by. (`palpate_engine::tracking::Sighting` says what is what.)
// use shared/structs

struct Crowd { // mirrored
    // Places K, points N, cameras C.
    places: u32,
    points: u32,
    cameras: u32,
    // Every so-manieth place and point is in the cubes.
    thin: u32,
    // Entries of a section of the hash, and how many sections there are.
    span: u32,
    sections: u32,
    // Cubes, all and along each axis.
    cells: u32,
    pad: u32,
    cubes: vec3<u32>,
    pad_cubes: u32,
    // Lowest corner of the cubes [m].
    low: vec3<f32>,
    inverse_edge: f32,
    // Square of the distance up to which somebody is near [m²].
    reach: f32,
    // −1/(2σ²) [1/m²].
    falloff: f32,
    // What outliers weigh against the peak of a place, over the areas of all that are seen.
    floor: f32,
    // How far behind the nearest place on a line of sight one may lie [m].
    slack: f32,
}

struct Eye { // mirrored
    // Centre [m]; then 1, or 0 for a camera without lines of sight.
    center: vec4<f32>,
    // Unit vector along which depth counts; then pixels over the tangent of an angle.
    axis: vec4<f32>,
    right: vec4<f32>,
    down: vec4<f32>,
}

var<uniform> crowd: Crowd;
// Position [m]; then the area over the mean of all.
var<storage, read> crowd_places: array<vec4<f32>>;
// Outward, of any length.
var<storage, read> crowd_normals: array<vec4<f32>>;
// Position [m]; then the number of the camera.
var<storage, read> crowd_points: array<vec4<f32>>;
var<storage, read> eyes: array<Eye>;

// Sections of the hash: places by cube, points by cube, for every camera the places that face it by pixel, then for every camera its points.
const PLACES = 0u;
const POINTS = 1u;
const PICTURES = 2u;

// Key of what lies in no cube or pixel: it comes last.
const NOWHERE = 0xffffffffu;
// Pixels from the axis that a key has room for.
const FARTHEST = 32767.0;

// Cubes beyond the lattice are told from those at its edge, not from each other.
fn cube_of(p: vec3<f32>) -> vec3<i32> {
    let most = vec3<f32>(crowd.cubes) + vec3(1.0);
    return vec3<i32>(clamp(floor((p - crowd.low) * crowd.inverse_edge), vec3(-2.0), most));
}

fn cube_key(p: vec3<f32>) -> u32 {
    let c = cube_of(p);
    if any(c < vec3(0)) || any(c >= vec3<i32>(crowd.cubes)) {
        return NOWHERE;
    }
    let u = vec3<u32>(c);
    return (u.z * crowd.cubes.y + u.y) * crowd.cubes.x + u.x;
}

struct Pixel {
    key: u32,
    depth: f32,
}

fn pixel_of(eye: Eye, p: vec3<f32>) -> Pixel {
    let away = p - eye.center.xyz;
    let depth = dot(away, eye.axis.xyz);
    var pixel = Pixel(NOWHERE, depth);
    if eye.center.w > 0.0 && depth > 0.0 {
        let at = floor(vec2(dot(away, eye.right.xyz), dot(away, eye.down.xyz)) / depth * eye.axis.w + vec2(0.5));
        if all(abs(at) < vec2(FARTHEST)) {
            let u = vec2<u32>(vec2<i32>(at) + vec2(32768));
            pixel.key = (u.x << 16u) | u.y;
        }
    }
    return pixel;
}

fn faces(eye: Eye, place: u32) -> bool {
    return dot(crowd_normals[place].xyz, crowd_places[place].xyz - eye.center.xyz) < 0.0;
}

// Number of an invocation in a grid that may be folded.
fn flat_id(group: vec3<u32>, groups: vec3<u32>, local: u32, width: u32) -> u32 {
    return (group.x + group.y * groups.x) * width + local;
}
