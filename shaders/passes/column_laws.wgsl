//! Adds ∂r/∂p of the laws of cells to what press_column left. call.extra is the kind of the parameter, plus 32 times the row of a
//! field's slopes; for a law's own parameter 32 · (16 · law + number).
// use effects/cells
// use shared/slopes
// use shared/keys

var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn column_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let kind = call.extra % 32u;
    let index = call.extra / 32u;
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    var young = c.young;
    // Body-frame forces of the two poses for E = 1, the old one without its weight.
    var y = vec3(0.0);
    var y_old = vec3(0.0);
    if kind == POISSON_RATIO {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        let kq = stiff(by_nu, c.number, fresh.q);
        let kq_old = stiff(by_nu, c.number, old.q);
        let kd = stiff(by_nu, c.number, fresh.q - old.q);
        var ds = nowhere();
        ds[0] = 0.5 * mean(c, fresh.q, kq);
        let r = ask(c, ENERGY_PART, fresh.s, ds, NONE, 0u);
        let change = vec2(0.5 * mean(c, fresh.q - old.q, kd), 0.5 * mean(c, old.q, kq_old));
        let loss = loss_of(c, w, old, change, NONE, 0u);
        y = c.mix.fresh * (stress(c, fresh, r.bend) + r.first[0] * kq) + loss.y * kd + loss.z * w.kd;
        ds[0] = change.y;
        let before = ask(c, ENERGY_PART, old.s, ds, NONE, 0u);
        y_old = stress(c, old, before.bend) + before.first[0] * kq_old;
    } else if kind == REST_SLOPE {
        let shifted = free_pose(rests[c.node].xyz - rests[c.first].xyz, c.sign);
        let dq = -strain_rate(shifted, rest_slope(index, c.node) - rest_slope(index, c.first), c.sign);
        let loss = loss_of(c, w, old, vec2(0.0, mean(c, old.kq, dq)), NONE, 0u);
        y = c.mix.fresh * stress_rate(c, fresh, dq) + loss.z * w.kd;
        y_old = stress_rate(c, old, dq);
    } else if kind == EFFECT {
        let law = index / 16u;
        let slot = index % 16u;
        let r = ask(c, ENERGY_PART, fresh.s, nowhere(), law, slot);
        let loss = loss_of(c, w, old, vec2(0.0), law, slot);
        y = c.mix.fresh * stress(c, fresh, r.bend) + loss.z * w.kd;
        y_old = stress(c, old, ask(c, ENERGY_PART, old.s, nowhere(), law, slot).bend);
    } else {
        // Stiffness: the force is proportional to it.
        young = c.young / c.m.young;
        if kind == MODULUS_SLOPE {
            young = modulus_slope(c.m, c.member, c.cell, index);
        }
        if kind == AGING_SLOPE {
            young = aging_slope(c.m, c.member, c.cell, index);
        }
        let r = ask(c, ENERGY_PART, fresh.s, nowhere(), NONE, 0u);
        let loss = loss_of(c, w, old, vec2(0.0), NONE, 0u);
        y = c.mix.fresh * stress(c, fresh, r.first) + loss.y * w.kd;
        y_old = stress(c, old, ask(c, ENERGY_PART, old.s, nowhere(), NONE, 0u).first);
    }
    let f = force(fresh.pose, young * y, c.sign) + force(old.pose, (young * c.mix.old) * y_old, c.sign);
    if c.live {
        cell_force[c.at] += vec4(f, 0.0);
    }
}
