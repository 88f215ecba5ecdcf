//! Displacements of nodes: simulated minus measured. Twin of palpate-cpu/src/costs/displacements.rs.
// use shared/look
// use shared/found

// First row of an observed node.
fn displacement_row(slot: u32, shot: Shot, node: u32) -> u32 {
    return slot * sight.rows + shot.point_count + 3u * (shot.marker_count + node);
}

// dJ/du of an observed node by its own displacement.
fn displacement_pull(slot: u32, shot: Shot, node: u32) -> vec3<f32> {
    let row = displacement_row(slot, shot, node);
    return vec3(rows[row].x, rows[row + 1u].x, rows[row + 2u].x) * rows[row].y;
}
