//! A product with the assembled matrix by one workgroup of 256.
// use shared/blocks

// A times the vector that was set; returns the one along the other.
fn multiply_alone(local: u32, p: Share) -> f32 {
    storageBarrier();
    workgroupBarrier();
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var bend = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        let row = Place(p.member, p.home, i, true, true);
        var q = heavy_row(m, inertia, row);
        for (var k = block_rows[i]; k < block_rows[i + 1u]; k++) {
            q = with_block(q, m, row, inertia, k);
        }
        solving[solving_part(IMAGE) + a] = vec4(q, 0.0);
        bend.x += dot(operand_at(a), q);
    }
    return total(local, bend).x;
}
