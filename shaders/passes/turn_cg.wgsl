//! Conjugate gradients by many workgroups, first of an iteration: has it converged? If not, p ← M⁻¹ r + β p.
// use shared/grid
// use shared/totals
// use shared/precondition
// use shared/iteration

var<storage, read> newton: array<Newton>;
var<storage, read> cg_rest: array<vec4<f32>>;
var<storage, read_write> cg_along: array<vec4<f32>>;

@compute @workgroup_size(256)
fn turn_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, WIDE);
    if !p.runs {
        return;
    }
    let rz = sum_parts(local, p.member, 1u, WIDE);
    let before = cg_scalars[4u * p.member + 1u - parity()];
    let bad = cg_scalars[4u * p.member + 3u - parity()].x;
    var state = before.z;
    if state == 0.0 {
        if bad != 0.0 {
            state = 2.0;
        } else if !(sqrt(max(rz, 0.0)) > newton[p.member].goal) || before.y >= f32(shape.most) {
            state = 1.0;
        }
    }
    // The first of the member's workgroups speaks for all.
    if p.item == 0u {
        cg_scalars[4u * p.member + parity()] = vec4(rz, before.y + select(0.0, 1.0, state == 0.0), state, 0.0);
    }
    if state != 0.0 || !p.live {
        return;
    }
    // Before the first iteration nothing came.
    var beta = 0.0;
    if before.x != 0.0 {
        beta = rz / before.x;
    }
    let a = at_node(p.member, p.item);
    cg_along[a] = vec4(scaled(at_node(p.home, p.item), cg_rest[a].xyz), 0.0) + beta * cg_along[a];
}
