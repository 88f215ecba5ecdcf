//! Derivatives by the planes: stiffness that follows Young's modulus, height, and both angles of each.
// use shared/mix
// use shared/contact
// use shared/patch_way
// use shared/probed
// use shared/pulls

var<batch> planes: array<Plane>;
// [planes][B][workgroups]: by Young's modulus, height and angles.
var<storage, read_write> patch_sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    let which = min(p.item, shape.patches - 1u);
    let site = patches[which];
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let along = acts_along(theta);
    let way = patch_way(p.member, which, site.xyz, along);
    let z = probe_at(p.member, patch_stencil(which));
    let width = shape.contact_width;
    for (var k = 0u; k < shape.planes; k++) {
        let plane = planes[p.member * shape.planes + k];
        let n = plane.normal.xyz;
        let gap = (dot(n, way.whole) - plane.normal.w) + dot(n, way.rest);
        let old_gap = (dot(n, way.old_whole) - plane.normal.w) + dot(n, way.old_rest);
        let s = site.w * plane.stiffness;
        var by = vec4(0.0);
        for (var i = 0u; i < instant_count; i++) {
            let at = instant(i, theta);
            if at.x == 0.0 || min(gap, old_gap) >= width || !p.live {
                break;
            }
            let law = contact_law(gap + (1.0 - at.y) * (old_gap - gap), width);
            let pressure = s * at.x * law.pressure;
            let slope = s * at.x * law.slope;
            let place = (way.whole + way.rest) + (1.0 - at.y) * ((way.old_whole - way.whole) + (way.old_rest - way.rest));
            by.x += pressure * plane.scales / members[p.member].young * dot(n, z);
            by.y -= slope * dot(n, z);
            by.z += slope * dot(plane.by_theta.xyz, place) * dot(n, z) + pressure * dot(plane.by_theta.xyz, z);
            by.w += slope * dot(plane.by_phi.xyz, place) * dot(n, z) + pressure * dot(plane.by_phi.xyz, z);
        }
        let sum = sum64(local, by);
        if local == 0u && p.live {
            // Forces are the pressure's opposite.
            patch_sums[row_at(k, p.member, p.item, shape.patches, 64u)] += sum;
        }
    }
}
