//! Leaves the stiffness of springs out of what rounding is measured by: nothing is balanced where a node is held.
// use shared/grid
// use shared/held

// As invert_diagonal has it.
var<storage, read_write> inverses: array<vec4<f32>>;

@compute @workgroup_size(64)
fn forget_springs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if p.live && is_held(p.member, p.item) {
        inverses[2u * at_node(p.member, p.item) + 1u].z = 0.0;
    }
}
