//! Adds the derivative of the laws of cells by the old state, times the vector `probe` (ALONG), or its transpose, to what
//! couple_old left.
// use effects/cells
// use shared/asks

var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn couple_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let d = probe[c.node].xyz - probe[c.first].xyz;
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    let matrix = stiffness_of(c);
    let by_d = loss_of(c, w, old, vec2(1.0, 0.0));
    let by_old = loss_of(c, w, old, vec2(0.0, 1.0)).z;
    let flow = flow_way(c, fresh, old);
    var f = vec3(0.0);
    if call.extra == ALONG {
        let dq = strain_rate(old.pose, d, c.sign);
        let along = by_old * mean(c, old.kq, dq) - by_d.z * mean(c, w.kd, dq);
        let y = c.young * (along * w.kd - by_d.y * stiff(matrix, c.number, dq));
        f = force(fresh.pose, y + flow_by_old(c, flow, dq), c.sign);
    } else {
        let dq = strain_rate(fresh.pose, d, c.sign);
        let along = mean(c, w.kd, dq);
        let y = along * (by_old * old.kq - by_d.z * w.kd) - by_d.y * stiff(matrix, c.number, dq);
        f = force(old.pose, c.young * y + flow_by_old(c, flow, dq), c.sign);
    }
    // The old state's own force, whose derivative is symmetric.
    let body = centred(transpose(old.pose.r) * d);
    let dq = strain_rate(old.pose, d, c.sign);
    let r = ask_energy(c, old.s, scalar_rates(c, old, dq));
    let rate = c.young * (stress(c, old, r.bend) + r.first[0] * stiff(matrix, c.number, dq));
    let own = force_body(old.pose, centred(rate), c.sign)
        + second_body(old.pose, centred(c.young * stress(c, old, r.first)), body, c.sign);
    f += old.pose.r * (c.mix.old * own);
    if c.live {
        cell_force[c.at] += vec4(f, 0.0);
    }
}
