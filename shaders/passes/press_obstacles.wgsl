//! What obstacles do to every surface patch, added to what touch_patches left; call.extra as shared/asks says.
// use shared/obstacle
// use shared/probed
// use shared/rates
// use shared/asks

var<storage, read> newton: array<Newton>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_obstacles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let site = patches[p.item];
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let way = patch_way(p.member, p.item, vec3(0.0), acts_along(theta));
    var mean = vec3(0.0);
    if call.extra == TOUCH_OLD || call.extra == TOUCH_BACK {
        mean = probe_at(p.member, patch_stencil(p.item));
    }
    let exact = newton[p.member].convex == 0u;
    var vector = vec4(0.0);
    var diagonal = vec3(0.0);
    var mixed = vec3(0.0);
    for (var k = 0u; k < shape.obstacles; k++) {
        let t = touch_obstacle(k, p.member, site.xyz, way, theta);
        if !t.felt {
            continue;
        }
        let value = obstacles[k].value;
        let stiffness = effect_values[p.member * obstacles[k].stride + value];
        let s = site.w * stiffness;
        let n = t.fresh.normal;
        switch call.extra {
            case TOUCH_OLD: { vector += vec4((s * t.by_past * dot(t.past.normal, mean)) * n, 0.0); }
            case TOUCH_BACK: { vector += vec4((s * t.by_past * dot(n, mean)) * t.past.normal, 0.0); }
            case TOUCH_ALONG: {
                let at = numbers_at(p.member) + shape.rate_effects + value;
                let offset = vec3(rate_numbers[at + 1u], rate_numbers[at + 2u], rate_numbers[at + 3u]);
                let moved = shifted(t, offset) + rates[p.member].start * later(t);
                vector += vec4(s * moved + (site.w * rate_numbers[at] * t.pressure) * n, 0.0);
            }
            case TOUCH_STIFFNESS: {
                diagonal -= (s * t.by_fresh) * (n * n);
                mixed -= (s * t.by_fresh) * (n.xxy * n.yzz);
                // The obstacle's curvature, which may make the matrix indefinite.
                if exact {
                    let bend = t.fresh.hessian * (s * t.pressure);
                    diagonal -= vec3(bend[0].x, bend[1].y, bend[2].z);
                    mixed -= vec3(bend[0].y, bend[0].z, bend[1].z);
                }
            }
            default: { vector += vec4((s * t.pressure) * n, s * t.energy); }
        }
    }
    let at = 3u * (p.member * shape.patches + p.item);
    supports[at] += vector;
    if call.extra == TOUCH_STIFFNESS {
        supports[at + 1u] += vec4(diagonal, 0.0);
        supports[at + 2u] += vec4(mixed, 0.0);
    }
}
