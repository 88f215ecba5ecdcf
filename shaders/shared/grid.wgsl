//! Which member and which item an invocation works on. Members that take part stand in a section of the roster, which starts where
//! call.roster says; their workgroups follow each other, and grids wider than a device allows are folded into two dimensions. In
//! solves for several columns at once every column of a member counts as one: column q of member b has the number q B + b.
// use shared/structs

var<uniform> shape: Shape;
var<storage, read> roster: array<u32>;

// A workgroup's share, the same for all its invocations, which is what barriers after a look at it need.
struct Share {
    member: u32,
    // The member whose matrix and parameters these are.
    home: u32,
    // Item of the first invocation.
    first: u32,
    runs: bool,
}

fn find_share(group: vec3<u32>, groups: vec3<u32>, items: u32, width: u32) -> Share {
    let each = max((items + width - 1u) / width, 1u);
    let flat = group.x + group.y * groups.x;
    let slot = flat / each;
    var s: Share;
    s.runs = slot < roster[call.roster];
    if s.runs {
        s.member = roster[call.roster + 1u + slot];
    }
    s.home = s.member % shape.members;
    s.first = (flat % each) * width;
    return s;
}

// An invocation's own item of the share. One beyond the end is not live and must not write.
struct Place {
    member: u32,
    home: u32,
    item: u32,
    // Whole workgroups run or not.
    runs: bool,
    live: bool,
}

fn place_in(s: Share, local: u32, items: u32) -> Place {
    let item = s.first + local;
    return Place(s.member, s.home, item, s.runs, s.runs && item < items);
}

fn find_place(group: vec3<u32>, groups: vec3<u32>, local: u32, items: u32, width: u32) -> Place {
    return place_in(find_share(group, groups, items, width), local, items);
}

// States hold three vectors per node, [3][B][N]: a multiple of the quantum, the rest of the displacement, the velocity.
fn at_node(member: u32, node: u32) -> u32 {
    return member * shape.nodes + node;
}

fn part(which: u32) -> u32 {
    return which * shape.members * shape.nodes;
}

// Where `cell_force` has what supports give to the corners, after what cells do.
fn support_part() -> u32 {
    return 8u * shape.members * shape.cells;
}

// Where `supports` has what clamps do to corners, after what planes do to patches.
fn hold_part() -> u32 {
    return 3u * shape.members * shape.patches;
}
