//! Displacements of the simulation nodes at the looks' instants: the cubic Hermite curve through both ends of the step.
// use shared/seen

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;

@compute @workgroup_size(64)
fn see_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs || index >= sight.nodes {
        return;
    }
    let a = s.look.member * sight.nodes + index;
    let plane = sight.members * sight.nodes;
    let f = s.look.value;
    // The factors of u₀ and u₁ sum to one.
    let moved = (next[a].xyz - now[a].xyz) + (next[plane + a].xyz - now[plane + a].xyz);
    let curve = f.z * moved + (f.y * now[2u * plane + a].xyz + f.w * next[2u * plane + a].xyz);
    let at = seen_at(s.slot, index);
    seen[at] = vec4(now[a].xyz, 0.0);
    seen[rest_part() + at] = vec4(now[plane + a].xyz + curve, 0.0);
}
