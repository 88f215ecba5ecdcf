//! The same of an effect on patches, at every plane where it is one of contact.
// use shared/pull_point

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read> cells: array<Cell>;
var<storage, read> patches: array<Patch>;
var<storage, read> planes: array<Plane>;

@compute @workgroup_size(64)
fn pull_patch_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    let effect = effects[asked_effect()];
    let m = members[p.member];
    let site = patches[min(p.item, shape.patches - 1u)];
    var whole = vec3(0.0);
    var rest = vec3(0.0);
    var old_whole = vec3(0.0);
    var old_rest = vec3(0.0);
    var mean = vec3(0.0);
    for (var i = 0u; i < 8u; i++) {
        let a = at_node(p.member, cells[site.cell].nodes[i]);
        let w = site.weights[i];
        whole += w * next[a].xyz;
        rest += w * next[part(1u) + a].xyz;
        old_whole += w * now[a].xyz;
        old_rest += w * now[part(1u) + a].xyz;
        mean += w * probe[a].xyz;
    }
    prepare(effect, p.member, m, mix_of(m));
    place_point(site.point.xyz, whole, rest, old_whole, old_rest, vec3(0.0));
    measure = number(site.point.w);
    aim(mean);
    let at_planes = effect.site == AT_CONTACT;
    for (var k = 0u; k < max(shape.planes, 1u); k++) {
        var by = vec3(0.0);
        if at_planes && k < shape.planes {
            let plane = planes[p.member * shape.planes + k];
            for (var i = 0u; i < 4u; i++) {
                z[PLANE_AT + i] = number(plane.normal[i]);
            }
            z[PLANE_AT + 4u] = number(plane.stiffness);
            add_inputs(effect, plane.scales * DEFAULT_STIFFNESS / shape.h);
            if is_sought(SEEK_PLANES) {
                by = vec3(by_one(effect.law, PLANE_AT + 3u, 1.0), by_normal(effect.law, plane.by_theta.xyz),
                          by_normal(effect.law, plane.by_phi.xyz));
            }
        } else if !at_planes && k == 0u {
            add_inputs(effect, 0.0);
        }
        for (var i = 0u; i < PLANE_ROWS; i++) {
            take(local, effect.count + POINT_ROWS + PLANE_ROWS * k + i, p.live, p.member, p.item / 64u, by[i]);
        }
    }
    take_inputs(local, effect, p.live, p.member, p.item / 64u);
}
