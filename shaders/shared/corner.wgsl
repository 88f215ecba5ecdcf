//! The corner of a cell that an invocation works on: eight neighbouring lanes are a cell, lanes beyond the last cell repeat it.
// use shared/cells
// use shared/unstrained

struct Corner {
    // False for lanes that must not write.
    live: bool,
    member: u32,
    cell: u32,
    // 0 to 7, and its signs along the axes.
    number: u32,
    sign: vec3<f32>,
    // Its node in a state, and that of the cell's first corner, from which displacements are counted.
    node: u32,
    first: u32,
    // Its place in what is kept per corner.
    at: u32,
    m: Member,
    mix: Mix,
    // Young's modulus of the cell.
    young: f32,
}

// Pose of the cell in the stress-free shape.
fn rest_pose(c: Corner) -> Pose {
    return pose_of(rests[c.node].xyz - rests[c.first].xyz, c.sign);
}

fn find_corner(group: vec3<u32>, groups: vec3<u32>, local: u32) -> Corner {
    lanes_start(local);
    let p = find_place(group, groups, local / 8u, shape.cells, 8u);
    var c: Corner;
    c.live = p.live;
    c.member = p.member;
    c.cell = min(p.item, shape.cells - 1u);
    c.number = local % 8u;
    c.sign = sign_of(c.number);
    c.node = at_node(p.member, cells[c.cell].nodes[c.number]);
    c.first = at_node(p.member, cells[c.cell].nodes[0]);
    c.at = (p.member * shape.cells + c.cell) * 8u + c.number;
    c.m = members[p.member];
    c.mix = mix_of(c.m);
    c.young = young_at(c.m, p.member, c.cell);
    return c;
}
