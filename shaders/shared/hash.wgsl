//! The hash once it is sorted: entries (key, item) section by section, and where the cubes of the first two sections start.
// use shared/crowd

// [sections][span]: in sections of places by pixel the item is the bits of a depth, which grow with it.
var<storage, read> entries: array<vec2<u32>>;
// [2][cells + 1]
var<storage, read> starts: array<u32>;

// First entry of a section whose key is not below this one.
fn first_of(section: u32, key: u32) -> u32 {
    var low = section * crowd.span;
    var high = low + crowd.span;
    for (var k = 0u; k < 32u; k++) {
        if low >= high {
            break;
        }
        let middle = (low + high) / 2u;
        if entries[middle].x < key {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Whether a section has this key at the place where it would begin.
fn holds(section: u32, at: u32, key: u32) -> bool {
    return at < (section + 1u) * crowd.span && entries[at].x == key;
}

// The 27 cubes around a position are nine rows of three. First entry of a row and one past its last.
fn row_near(section: u32, p: vec3<f32>, row: u32) -> vec2<u32> {
    let c = cube_of(p) + vec3(0, i32(row % 3u) - 1, i32(row / 3u) - 1);
    let last = vec3<i32>(crowd.cubes) - vec3(1);
    let low = max(c.x - 1, 0);
    let high = min(c.x + 1, last.x);
    if any(c.yz < vec2(0)) || any(c.yz > last.yz) || low > high {
        return vec2(0u);
    }
    let at = section * (crowd.cells + 1u) + (u32(c.z) * crowd.cubes.y + u32(c.y)) * crowd.cubes.x;
    return vec2(starts[at + u32(low)], starts[at + u32(high) + 1u]);
}
