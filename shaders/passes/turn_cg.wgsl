//! Conjugate gradients by many workgroups, first of an iteration: has it converged? If not, p ← M⁻¹ r + β p.
// use shared/grid
// use shared/totals
// use shared/precondition
// use shared/iteration

var<storage, read> newton: array<Newton>;
var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn turn_cg(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, WIDE);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    let rz = sum_parts(local, share.member, 1u, WIDE);
    let before = cg_sums[scalars_at(p.member) + 1u - parity()];
    let bad = cg_sums[scalars_at(p.member) + 3u - parity()].x;
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
        cg_sums[scalars_at(p.member) + parity()] = vec4(rz, before.y + select(0.0, 1.0, state == 0.0), state, 0.0);
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
    let way = solving_part(ALONG_WAY) + a;
    let rest = solving[solving_part(REST) + a].xyz;
    solving[way] = vec4(scaled(at_node(p.home, p.item), rest), 0.0) + beta * solving[way];
}
