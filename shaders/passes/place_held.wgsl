//! Puts nodes that are held where their clamps want them, whatever the trial says.
// use shared/wanted
// use shared/flight

var<storage, read_write> next: array<vec4<f32>>;
var<storage, read_write> trial: array<vec4<f32>>;

@compute @workgroup_size(64)
fn place_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live || !is_held(p.member, p.item) {
        return;
    }
    let a = at_node(p.member, p.item);
    let u = wanted_at(p.member, p.item);
    let whole = round(u / shape.quantum) * shape.quantum;
    next[a] = vec4(whole, 0.0);
    next[part(1u) + a] = vec4(u - whole, 0.0);
    trial[a] = vec4(beyond_flight(p.member, a, whole, u - whole), 0.0);
}
