//! Derivatives by the planes: stiffness that follows Young's modulus, height, and both angles of each.
// use shared/mix
// use shared/contact
// use shared/pulls

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read> cells: array<Cell>;
var<storage, read> patches: array<Patch>;
var<storage, read> planes: array<Plane>;
// [planes][B][workgroups]: by Young's modulus, height and angles.
var<storage, read_write> patch_sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    let site = patches[min(p.item, shape.patches - 1u)];
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let along = acts_along(theta);
    var whole = site.point.xyz;
    var rest = vec3(0.0);
    var old_whole = site.point.xyz;
    var old_rest = vec3(0.0);
    var z = vec3(0.0);
    for (var i = 0u; i < 8u; i++) {
        let a = at_node(p.member, cells[site.cell].nodes[i]);
        let w = site.weights[i];
        whole += w * next[a].xyz;
        rest += w * next[part(1u) + a].xyz;
        old_whole += w * now[a].xyz;
        old_rest += w * now[part(1u) + a].xyz;
        z += w * probe[a].xyz;
    }
    if !along {
        old_whole = whole;
        old_rest = rest;
    }
    let width = shape.contact_width;
    for (var k = 0u; k < shape.planes; k++) {
        let plane = planes[p.member * shape.planes + k];
        let n = plane.normal.xyz;
        let gap = (dot(n, whole) - plane.normal.w) + dot(n, rest);
        let old_gap = (dot(n, old_whole) - plane.normal.w) + dot(n, old_rest);
        let s = site.point.w * plane.stiffness;
        var by = vec4(0.0);
        for (var i = 0u; i < instant_count; i++) {
            let at = instant(i, theta);
            if at.x == 0.0 || min(gap, old_gap) >= width || !p.live {
                break;
            }
            let law = contact_law(gap + (1.0 - at.y) * (old_gap - gap), width);
            let pressure = s * at.x * law.pressure;
            let slope = s * at.x * law.slope;
            let place = (whole + rest) + (1.0 - at.y) * ((old_whole - whole) + (old_rest - rest));
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
