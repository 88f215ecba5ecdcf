//! Adds the force of the laws of cells to what press_cells left on the corners, with their energy; or with call.extra 1 their force at
//! the old state, which a step keeps, to what press_old left.
// use effects/cells

var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let old = old_side(c);
    var f = vec3(0.0);
    var energy = 0.0;
    if call.extra == 1u {
        let r = ask(c, ENERGY_PART, old.s, nowhere(), NONE, 0u);
        f = force(old.pose, (c.mix.old * c.young) * stress(c, old, r.first), c.sign);
    } else {
        let fresh = new_side(c);
        let w = way_of(c, fresh, old);
        let r = ask(c, ENERGY_PART, fresh.s, nowhere(), NONE, 0u);
        let loss = loss_of(c, w, old, vec2(0.0), NONE, 0u);
        f = force(fresh.pose, c.young * (c.mix.fresh * stress(c, fresh, r.first) + loss.y * w.kd), c.sign);
        energy = c.young * volume_of(c) * (c.mix.fresh * r.value + loss.x) * 0.125;
    }
    if c.live {
        cell_force[c.at] += vec4(f, energy);
    }
}
