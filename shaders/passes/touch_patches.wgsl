//! What the planes do to every surface patch: the vector that corner forces take with the minus sign and their shape function,
//! and the patch's stiffness; or, as call.extra asks (shared/asks), the vector of ∂r/∂p instead.
// use shared/mix
// use shared/contact
// use shared/asks

var<storage, read> next: array<vec4<f32>>;
var<storage, read> cells: array<Cell>;
var<storage, read> patches: array<Patch>;
var<storage, read> planes: array<Plane>;
var<storage, read_write> touches: array<vec4<f32>>;

@compute @workgroup_size(64)
fn touch_patches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let site = patches[p.item];
    var whole = site.point.xyz;
    var rest = vec3(0.0);
    for (var i = 0u; i < 8u; i++) {
        let a = at_node(p.member, cells[site.cell].nodes[i]);
        whole += site.weights[i] * next[a].xyz;
        rest += site.weights[i] * next[part(1u) + a].xyz;
    }
    let area = site.point.w;
    let width = contact_width * shape.h;
    let what = call.extra % PLANE_ASKS;
    var vector = vec3(0.0);
    var energy = 0.0;
    var diagonal = vec3(0.0);
    var mixed = vec3(0.0);
    for (var k = 0u; k < shape.planes; k++) {
        if what >= PLANE_HEIGHT && k != call.extra / PLANE_ASKS {
            continue;
        }
        let plane = planes[p.member * shape.planes + k];
        let n = plane.normal.xyz;
        let gap = (dot(n, whole) - plane.normal.w) + dot(n, rest);
        let law = contact_law(gap, width);
        let s = area * plane.stiffness;
        switch what {
            case TOUCH_YOUNG: { vector += (s * law.pressure * plane.scales / members[p.member].young) * n; }
            case PLANE_HEIGHT: { vector -= (s * law.slope) * n; }
            case PLANE_THETA: { vector += s * (law.slope * dot(plane.by_theta.xyz, whole + rest) * n + law.pressure * plane.by_theta.xyz); }
            case PLANE_PHI: { vector += s * (law.slope * dot(plane.by_phi.xyz, whole + rest) * n + law.pressure * plane.by_phi.xyz); }
            case NO_TOUCH: {}
            default: {
                vector += (s * law.pressure) * n;
                energy += s * law.energy;
                diagonal -= (s * law.slope) * (n * n);
                mixed -= (s * law.slope) * (n.xxy * n.yzz);
            }
        }
    }
    let at = 3u * (p.member * shape.patches + p.item);
    touches[at] = vec4(vector, energy);
    if what == TOUCH_FORCE {
        touches[at + 1u] = vec4(diagonal, 0.0);
        touches[at + 2u] = vec4(mixed, 0.0);
    }
}
