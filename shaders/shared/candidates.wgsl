//! Points of a frame that may lie in a cell. Points never move: they stand sorted by the cubes of a fixed lattice, row by row, and
//! a cell asks for the cubes of its bounding box. Points beyond the lattice stand in its outermost cubes.
// use shared/hexahedron

// Frame's points in the order of their cubes: position from the frame's origin [m], camera.
var<shots> points: array<vec4<f32>>;
var<shots> cube_starts: array<u32>;
var<shots> cameras: array<vec4<f32>>;

// In keys of matches: the side is one that the camera cannot see.
const HIDDEN = 0x80000000u;

struct Cubes {
    low: vec3<u32>,
    high: vec3<u32>,
}

fn cubes_of(e: Hexahedron, shot: Shot) -> Cubes {
    let last = vec3<f32>(shot.cubes) - vec3(1.0);
    var c: Cubes;
    c.low = vec3<u32>(clamp(floor((e.low - e.offset - shot.low) * shot.inverse_edge), vec3(0.0), last));
    c.high = vec3<u32>(clamp(floor((e.high - e.offset - shot.low) * shot.inverse_edge), vec3(0.0), last));
    return c;
}

// Candidates of one row of cubes: first, and one past the last.
fn row_of(c: Cubes, shot: Shot, y: u32, z: u32) -> vec2<u32> {
    let row = shot.cube_start + (z * shot.cubes.y + y) * shot.cubes.x;
    return vec2(cube_starts[row + c.low.x], cube_starts[row + c.high.x + 1u]);
}

fn in_box(e: Hexahedron, y: vec3<f32>) -> bool {
    return all(y >= e.low) && all(y <= e.high);
}

// Direction from its camera to a point of `points`, zero for a camera in the point and where nobody knows from where it was seen.
fn line_of_sight(p: vec4<f32>, shot: Shot) -> vec3<f32> {
    // Cameras are counted from the body's origin, points from the frame's.
    let camera = cameras[u32(p.w)];
    let line = ((p.xyz + shot.shift.xyz + shot.shift_rest.xyz) - camera.xyz) * camera.w;
    let size = length(line);
    return select(vec3(0.0), line / size, size > 0.0);
}
