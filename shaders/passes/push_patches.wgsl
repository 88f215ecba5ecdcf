//! Change of what planes do to every patch along a direction: by their height and angles, and by stiffness that follows Young's modulus; as
//! the vector that corner forces take with the minus sign and their shape function.
// use shared/mix
// use shared/contact
// use shared/patch_way
// use shared/rates

var<batch> planes: array<Plane>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let site = patches[p.item];
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let way = patch_way(p.member, p.item, site.xyz, acts_along(theta));
    let width = shape.contact_width;
    let stiffer = rates[p.member].young / members[p.member].young;
    var vector = vec3(0.0);
    for (var k = 0u; k < shape.planes; k++) {
        let plane = planes[p.member * shape.planes + k];
        let n = plane.normal.xyz;
        let gap = (dot(n, way.whole) - plane.normal.w) + dot(n, way.rest);
        let old_gap = (dot(n, way.old_whole) - plane.normal.w) + dot(n, way.old_rest);
        if min(gap, old_gap) >= width {
            continue;
        }
        let rate = plane_rate(p.member, k);
        let turned = rate.y * plane.by_theta.xyz + rate.z * plane.by_phi.xyz;
        let s = site.w * plane.stiffness;
        for (var i = 0u; i < instant_count; i++) {
            let at = instant(i, theta);
            if at.x == 0.0 {
                break;
            }
            let law = contact_law(gap + (1.0 - at.y) * (old_gap - gap), width);
            let pressure = s * at.x * law.pressure;
            let slope = s * at.x * law.slope;
            let place = (way.whole + way.rest) + (1.0 - at.y) * ((way.old_whole - way.whole) + (way.old_rest - way.rest));
            vector += (stiffer * plane.scales * pressure + slope * (dot(turned, place) - rate.x)) * n + pressure * turned;
        }
    }
    supports[3u * (p.member * shape.patches + p.item)] = vec4(vector, 0.0);
}
