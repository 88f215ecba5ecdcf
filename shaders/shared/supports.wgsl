//! What clamps and planes do to one corner of a cell, from the passes that computed them per clamp cell and per patch.
// use shared/patches

var<storage, read> supports: array<vec4<f32>>;

// Force, and this corner's share of the energy.
fn support_of(cell: Cell, member: u32, corner: u32) -> vec4<f32> {
    var sum = vec4(0.0);
    for (var m = cell.hold_start; m < cell.hold_end; m++) {
        sum += supports[hold_part() + (member * shape.holds + m) * 8u + corner];
    }
    for (var k = cell.patch_start; k < cell.patch_end; k++) {
        let t = supports[3u * (member * shape.patches + k)];
        let w = corner_weight(k, corner);
        sum += vec4(-w * t.xyz, w * t.w);
    }
    return sum;
}
