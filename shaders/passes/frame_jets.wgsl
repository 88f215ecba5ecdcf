//! The extent of every nozzle's picture, a workgroup a member.
// use shared/grid
// use shared/sight

var<storage, read> jet_sights: array<vec4<f32>>;
var<storage, read_write> jet_pictures: array<Picture>;

// Least x and y, least −x and −y; least −depth.
var<workgroup> corners: array<vec4<f32>, 64>;
var<workgroup> depths: array<f32, 64>;

@compute @workgroup_size(64)
fn frame_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    for (var k = 0u; k < shape.jets; k++) {
        var corner = vec4(1e30);
        var depth = 0.0;
        for (var i = local; i < shape.patches; i += 64u) {
            let sight = jet_sights[(k * shape.members + p.member) * shape.patches + i];
            if sight.z > 0.0 {
                corner = min(corner, vec4(sight.xy, -sight.xy));
                depth = min(depth, -sight.z);
            }
        }
        workgroupBarrier();
        corners[local] = corner;
        depths[local] = depth;
        workgroupBarrier();
        for (var step = 32u; step > 0u; step >>= 1u) {
            if local < step {
                corners[local] = min(corners[local], corners[local + step]);
                depths[local] = min(depths[local], depths[local + step]);
            }
            workgroupBarrier();
        }
        if local == 0u {
            var picture = Picture(corners[0].xy, 1.0, 0u);
            if depths[0] < 0.0 {
                let extent = -corners[0].zw - corners[0].xy;
                let most = max(extent.x, extent.y);
                // Pixels of half a mean patch, as the farthest one looks.
                picture.pixel = max(0.5 * shape.patch_size / -depths[0], most / (jet_side - 1.0));
                picture.side = u32(most / picture.pixel) + 1u;
            }
            jet_pictures[k * shape.members + p.member] = picture;
        }
    }
}
