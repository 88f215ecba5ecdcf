//! Which member and which item an invocation works on. Members that take part stand in a section of the roster, which starts where
//! call.roster says; their workgroups follow each other, and grids wider than a device allows are folded into two dimensions. In
//! solves for several columns at once every column of a member counts as one: column q of member b has the number q B + b.
// use shared/structs

var<uniform> shape: Shape;
var<storage, read> roster: array<u32>;

struct Place {
    member: u32,
    // The member whose matrix and parameters these are.
    home: u32,
    item: u32,
    // Whole workgroups run or not; an item beyond the end is not live and must not write.
    runs: bool,
    live: bool,
}

fn find_place(group: vec3<u32>, groups: vec3<u32>, local: u32, items: u32, width: u32) -> Place {
    let each = max((items + width - 1u) / width, 1u);
    let flat = group.x + group.y * groups.x;
    let slot = flat / each;
    var p: Place;
    p.runs = slot < roster[call.roster];
    if p.runs {
        p.member = roster[call.roster + 1u + slot];
    }
    p.home = p.member % shape.members;
    p.item = (flat % each) * width + local;
    p.live = p.runs && p.item < items;
    return p;
}

// States hold three vectors per node, [3][B][N]: a multiple of the quantum, the rest of the displacement, the velocity.
fn at_node(member: u32, node: u32) -> u32 {
    return member * shape.nodes + node;
}

fn part(which: u32) -> u32 {
    return which * shape.members * shape.nodes;
}
