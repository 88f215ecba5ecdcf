//! What the planes do to every surface patch along its way in a step: the vector that corner forces take with the minus sign and their shape
//! function, and the patch's stiffness; or what else call.extra asks for (shared/asks).
// use shared/mix
// use shared/contact
// use shared/patch_way
// use shared/probed
// use shared/asks

var<batch> planes: array<Plane>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn touch_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let site = patches[p.item];
    let what = call.extra;
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let along = acts_along(theta);
    let way = patch_way(p.member, p.item, site.xyz, along);
    var mean = vec3(0.0);
    if what == TOUCH_OLD {
        mean = probe_at(p.member, patch_stencil(p.item));
    }
    let area = site.w;
    let width = shape.contact_width;
    var vector = vec3(0.0);
    var energy = 0.0;
    var diagonal = vec3(0.0);
    var mixed = vec3(0.0);
    for (var k = 0u; k < shape.planes; k++) {
        if what == NO_TOUCH {
            break;
        }
        let plane = planes[p.member * shape.planes + k];
        let n = plane.normal.xyz;
        let gap = (dot(n, way.whole) - plane.normal.w) + dot(n, way.rest);
        let old_gap = (dot(n, way.old_whole) - plane.normal.w) + dot(n, way.old_rest);
        if min(gap, old_gap) >= width {
            continue;
        }
        let s = area * plane.stiffness;
        for (var i = 0u; i < instant_count; i++) {
            let at = instant(i, theta);
            if at.x == 0.0 {
                break;
            }
            let law = contact_law(gap + (1.0 - at.y) * (old_gap - gap), width);
            let pressure = s * at.x * law.pressure;
            let slope = s * at.x * law.slope;
            switch what {
                case TOUCH_OLD: { vector += ((1.0 - at.y) * slope * dot(n, mean)) * n; }
                default: {
                    vector += pressure * n;
                    energy += s * at.x / at.y * law.energy;
                    diagonal -= (at.y * slope) * (n * n);
                    mixed -= (at.y * slope) * (n.xxy * n.yzz);
                }
            }
        }
    }
    let at = 3u * (p.member * shape.patches + p.item);
    supports[at] = vec4(vector, energy);
    if what == TOUCH_FORCE {
        supports[at + 1u] = vec4(diagonal, 0.0);
        supports[at + 2u] = vec4(mixed, 0.0);
    }
}
