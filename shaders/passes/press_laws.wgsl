//! Adds the force of the laws of cells to what press_cells left on the corners, with their energy; or with call.extra 1 their force at
//! the old state, which a step keeps, to what press_old left.
// use effects/cells

var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let old = old_side(c);
    var side = old;
    var w: Way;
    var loss = vec3(0.0);
    var weight = c.mix.old;
    var flow: FlowWay;
    if call.extra == 0u {
        side = new_side(c);
        w = way_of(c, side, old);
        loss = loss_of(c, w, old, vec2(0.0));
        weight = c.mix.fresh;
        flow = flow_way(c, side, old);
    }
    let r = ask_energy(c, side.s, nowhere());
    let f = force(side.pose, c.young * (weight * stress(c, side, r.first) + loss.y * w.kd) + flow.by.y * flow.kd, c.sign);
    // Of the old state's force the potential is linear; gather_residual knows it.
    let density = c.young * (weight * r.value + loss.x) + flow.by.x;
    var energy = select(0.0, volume_of(c) * density * 0.125, call.extra == 0u);
    if r.value >= NOWHERE_FROM {
        // The material does not exist there: judge_trial sees it.
        energy = NOWHERE;
    }
    if c.live {
        cell_force[c.at] += vec4(f, energy);
    }
}
