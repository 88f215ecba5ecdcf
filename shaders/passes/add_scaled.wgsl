//! Adds a derivative by displacements and velocities to another, times a factor, which call.extra has the bits of.
// use shared/grid

var<storage, read> addend: array<vec4<f32>>;
var<storage, read_write> total: array<vec4<f32>>;

@compute @workgroup_size(64)
fn add_scaled(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    let factor = bitcast<f32>(call.extra);
    total[a] += factor * addend[a];
    total[part(1u) + a] += factor * addend[part(1u) + a];
}
