//! Order of entries of the hash: by key, then by what they hold. No two of a section of cubes are the same, so that the order is one alone.

fn before(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
}
