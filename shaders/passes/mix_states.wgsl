//! The weighted sum of two states, the newer one's weight being one less the older one's, which call.extra has the bits of. Of displacements the
//! difference is taken first: what both have in common costs no digits.
// use shared/grid

var<storage, read> newer: array<vec4<f32>>;
var<storage, read> older: array<vec4<f32>>;
var<storage, read_write> mixed: array<vec4<f32>>;

@compute @workgroup_size(64)
fn mix_states(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    let weight = bitcast<f32>(call.extra);
    let u = part(1u) + a;
    let v = part(2u) + a;
    let apart = (older[a] - newer[a]) + (older[u] - newer[u]);
    let rest = newer[u] + weight * apart;
    let steps = round(rest / shape.quantum);
    mixed[a] = newer[a] + steps * shape.quantum;
    mixed[u] = rest - steps * shape.quantum;
    mixed[v] = newer[v] + weight * (older[v] - newer[v]);
}
