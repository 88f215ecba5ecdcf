//! Adds the laws of cells to what tangent_cells left, and lists what else the tangent is made of: Σ ψ_kl r_k r_lᵀ + φ_dd r_d r_dᵀ with r the
//! world-frame gradients of V s and V d; and the same for the viscosity. `law_modes` holds per cell: factors of K and K₀, E φ_dd/V, the
//! viscosity's φ_dd/V; r_k, r_d and the viscosity's r_d per corner; the matrix E θ ψ_kl/V, two vectors a row.
// use effects/cells
// use shared/rank_six
// use shared/modes

var<storage, read> newton: array<Newton>;
var<storage, read_write> tangents: array<vec4<f32>>;
var<storage, read_write> law_modes: array<vec4<f32>>;

// The material's first derivatives, and its second ones along a change that is this lane's own. Where the convex
// part is wanted, the cell stays linear: what is left of its matrix without the mean strain is convex, the material need not be.
fn material_row(c: Corner, s: array<f32, SCALARS>, ds: array<f32, SCALARS>, convex: bool) -> Answer {
    var r: Answer;
    for (var i = 0u; i < SCALARS; i++) {
        strain_input(s, along_scalar(i), ds);
        let v = material_beyond(number(c.m.lame.x), number(c.m.lame.y));
        r.first[i] = v.y;
        r.bend[i] = select(v.w, 0.0, convex);
    }
    return r;
}

@compute @workgroup_size(64)
fn tangent_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let n = scalars();
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    // Every lane takes one row of ψ's second derivatives.
    let row = min(c.number, n - 1u);
    var ds = nowhere();
    ds[row] = 1.0;
    let convex = newton[c.member].convex != 0u;
    let majorised = newton[c.member].majorised != 0u;
    var r = ask(c, ENERGY_PART, fresh.s, ds);
    if material() != 0u {
        add_answer(&r, material_row(c, fresh.s, ds, convex));
    }
    let loss = loss_of(c, w, old, vec2(1.0, 0.0));
    let scale = c.young * (c.mix.fresh * r.first[0] + loss.y);
    let y = c.young * (c.mix.fresh * stress(c, fresh, r.first) + loss.y * w.kd);
    let half = rank_six(fresh.pose, stiffness_of(c), c.number, c.sign, scale, centred(y), convex);
    let flow = flow_way(c, fresh, old);
    let flowing = rank_six(fresh.pose, flow_matrix(c), c.number, c.sign, flow.by.y, centred(flow.by.y * flow.kd), convex);
    let turned = fresh.pose.r * (half + flowing);
    let unit = c.young / volume_of(c);
    let at = mode_at(c.member, c.cell, n);
    let own = corner_mode(at, n, c.number);
    let by_way = force(fresh.pose, w.kd, c.sign);
    let by_flow = force(fresh.pose, flow.kd, c.sign);
    if c.live {
        for (var k = 0u; k < 3u; k++) {
            tangents[(c.member * shape.cells + c.cell) * TANGENT_VECTORS + 6u + 3u * c.number + k] += vec4(turned[k], 0.0);
        }
        law_modes[own + n] = vec4(by_way, 0.0);
        law_modes[own + n + 1u] = vec4(by_flow, 0.0);
        if c.number == 0u {
            law_modes[at] = vec4(scale, flow.by.y, unit * of_dissipation(majorised, loss.z),
                                 of_dissipation(majorised, flow.by.z) / volume_of(c));
        }
        if c.number < n {
            let b = r.bend;
            law_modes[row_mode(at, n, row)] = (unit * c.mix.fresh) * vec4(b[0], b[1], b[2], b[3]);
            law_modes[row_mode(at, n, row) + 1u] = (unit * c.mix.fresh) * vec4(b[4], b[5], b[6], 0.0);
        }
    }
    for (var k = 0u; k < SCALARS; k++) {
        if k >= n {
            break;
        }
        var one = nowhere();
        one[k] = 1.0;
        let by = force(fresh.pose, stress(c, fresh, one), c.sign);
        if c.live {
            law_modes[own + k] = vec4(by, 0.0);
        }
    }
}
