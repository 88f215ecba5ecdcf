//! Starts the solve of a step: the increment beyond free flight is zero, and so is the direction.
// use shared/grid

var<storage, read_write> increment: array<vec4<f32>>;
var<storage, read_write> solving: array<vec4<f32>>;
var<storage, read_write> newton: array<Newton>;

@compute @workgroup_size(64)
fn predict(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    increment[a] = vec4(0.0);
    solving[a] = vec4(0.0);
    if p.item == 0u {
        var n: Newton;
        n.stage = WANTS_TRIAL;
        n.forcing = 0.1;
        newton[p.member] = n;
    }
}
