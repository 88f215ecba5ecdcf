//! What an effect does to every surface patch, at every plane where it is one of contact, added to what touch_patches left.
//! call.extra as of press_nodes. No effect of patches reads the old velocity, so that BACK has nothing to say of it.
// use effects/patches
// use shared/patch_way
// use shared/probed

var<batch> planes: array<Plane>;
var<storage, read> newton: array<Newton>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let effect = effects[asked_effect()];
    let what = asked_question();
    let m = members[p.member];
    let site = patches[p.item];
    let way = patch_way(p.member, p.item, vec3(0.0), true);
    var mean = vec3(0.0);
    if what == BACK || what == BY_OLD {
        mean = probe_at(p.member, patch_stencil(p.item));
    }
    prepare(effect, p.member, m, mix_of(m));
    place_point(site.xyz, way.whole, way.rest, way.old_whole, way.old_rest, vec3(0.0));
    measure = number(site.w);
    let at = 3u * (p.member * shape.patches + p.item);
    var force = vec4(0.0);
    var diagonal = vec3(0.0);
    var mixed = vec3(0.0);
    for (var k = 0u; k < max(shape.planes, 1u); k++) {
        if (effect.site != AT_CONTACT && k > 0u) || (effect.site == AT_CONTACT && shape.planes == 0u) {
            break;
        }
        for (var i = 0u; i < inputs; i++) {
            change[i] = 0.0;
        }
        if what == BY_OLD {
            for (var i = 0u; i < 3u; i++) {
                change[OLD_AT + i] = mean[i];
            }
        }
        if what == COLUMN {
            change_along(effect, p.member);
        }
        if effect.site == AT_CONTACT {
            let plane = planes[p.member * shape.planes + k];
            for (var i = 0u; i < 4u; i++) {
                z[PLANE_AT + i] = number(plane.normal[i]);
            }
            z[PLANE_AT + 4u] = number(plane.stiffness);
            if what == COLUMN {
                let rate = plane_rate(p.member, k);
                let turned = rate.y * plane.by_theta.xyz + rate.z * plane.by_phi.xyz;
                for (var i = 0u; i < 3u; i++) {
                    change[PLANE_AT + i] = turned[i];
                }
                change[PLANE_AT + 3u] = rate.x;
                change[PLANE_AT + 4u] = plane.scales * rates[p.member].young * DEFAULT_STIFFNESS / shape.element_size;
            }
        }
        let r = respond(effect.law, what, mean);
        if what == STIFFNESS {
            if newton[p.member].convex == 0u || positive(r) {
                diagonal += r.b.xyz;
                mixed += r.c.xyz;
            }
        } else {
            force += r.a;
        }
    }
    // Corner forces take the vector with the minus sign.
    supports[at] += vec4(-force.xyz, select(0.0, force.w, what == FORCE));
    if what == STIFFNESS {
        supports[at + 1u] += vec4(diagonal, 0.0);
        supports[at + 2u] += vec4(mixed, 0.0);
    }
}
