//! Adds ∂r/∂p of the laws of cells to what press_column left. call.extra is the kind of the parameter, plus KEYS times the row of a
//! field's slopes; for a law's own parameter KEYS · (SLOTS · law + number).
// use effects/cells
// use shared/slopes
// use shared/keys

var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn column_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let kind = call.extra % KEYS;
    let index = call.extra / KEYS;
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    var young = c.young;
    // How the parameter changes the scalars, K q of both states and of the increment, and which law's parameter it is.
    var ds = nowhere();
    var ds_old = nowhere();
    var change = vec2(0.0);
    var kq = vec3(0.0);
    var kq_old = vec3(0.0);
    var kd = vec3(0.0);
    var law = NONE;
    if kind == POISSON_RATIO {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        kq = stiff(by_nu, c.number, fresh.q);
        kq_old = stiff(by_nu, c.number, old.q);
        kd = stiff(by_nu, c.number, fresh.q - old.q);
        ds[0] = 0.5 * mean(c, fresh.q, kq);
        ds_old[0] = 0.5 * mean(c, old.q, kq_old);
        change = vec2(0.5 * mean(c, fresh.q - old.q, kd), ds_old[0]);
    } else if kind == REST_SLOPE {
        let shifted = pose_of(rests[c.node].xyz - rests[c.first].xyz, c.sign);
        let dq = -strain_rate(shifted, rest_slope(index, c.node) - rest_slope(index, c.first), c.sign);
        kq = stiff(stiffness_of(c), c.number, dq);
        kq_old = kq;
        ds = scalar_rates(c, fresh, dq);
        ds_old = scalar_rates(c, old, dq);
        // The increment does not see it: both states shift alike.
        change.y = ds_old[0];
    } else if kind == EFFECT {
        law = index / SLOTS;
    }
    let r = ask(c, ENERGY_PART, fresh.s, ds, law, index % SLOTS);
    let before = ask(c, ENERGY_PART, old.s, ds_old, law, index % SLOTS);
    let loss = loss_of(c, w, old, change, law, index % SLOTS);
    // Body-frame forces of the two poses for E = 1, the old one without its weight.
    var y = c.mix.fresh * (stress(c, fresh, r.bend) + r.first[0] * kq) + loss.y * kd + loss.z * w.kd;
    var y_old = stress(c, old, before.bend) + before.first[0] * kq_old;
    if kind == YOUNGS_MODULUS || kind == MODULUS_SLOPE || kind == AGING_SLOPE {
        // The force is proportional to the stiffness.
        y = c.mix.fresh * stress(c, fresh, r.first) + loss.y * w.kd;
        y_old = stress(c, old, before.first);
        young = c.young / c.m.young;
        if kind == MODULUS_SLOPE {
            young = modulus_slope(c.m, c.member, c.cell, index);
        }
        if kind == AGING_SLOPE {
            young = aging_slope(c.m, c.member, c.cell, index);
        }
    }
    let f = force(fresh.pose, young * y, c.sign) + force(old.pose, (young * c.mix.old) * y_old, c.sign);
    if c.live {
        cell_force[c.at] += vec4(f, 0.0);
    }
}
