//! Change of the residual along a direction, per node: corners of cells from push_cells, and what acts on nodes: density, mass damping,
//! gravity, point masses, and what multiplies the ghost penalty.
// use shared/mix
// use shared/inertia
// use shared/motion
// use shared/rates
// use shared/unstrained

var<storage, read> cell_force: array<vec4<f32>>;
var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
// Of the factors on densities, as shared/inertia has them; and [B][N] of the stress-free shape.
var<rates> rate_densities: array<f32>;
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> column: array<vec4<f32>>;

// By what multiplies the ghost penalty, and by the stress-free shape.
fn by_ghosts(member: u32, node: u32, m: Member, mix: Mix) -> vec3<f32> {
    let r = rates[member];
    let a = at_node(member, node);
    let shear = r.young * m.ghost.x + m.young * m.ghost.y * r.poisson;
    let fixed = -mix.fresh - mix.old;
    var damped = 0.0;
    if call.mode != 0u {
        damped = m.young * m.ghost.x * r.stiffness_damping / shape.dt;
    }
    let on_new = shear * mix.on_ghost + damped;
    let on_old = shear * (mix.old - mix.rate) - damped;
    var f = vec3(0.0);
    for (var k = block_rows[node]; k < block_rows[node + 1u]; k++) {
        let b = at_node(member, columns[k]);
        let d1 = (next[b].xyz - next[a].xyz) + (next[part(1u) + b].xyz - next[part(1u) + a].xyz);
        f += (on_new * ghosts[k]) * d1;
        if call.mode != 0u {
            let d0 = (now[b].xyz - now[a].xyz) + (now[part(1u) + b].xyz - now[part(1u) + a].xyz);
            f += (on_old * ghosts[k]) * d0;
        }
        if has_rest() {
            f += (shear * fixed * ghosts[k]) * (rests[b].xyz - rests[a].xyz);
        }
        if with_rate(WITH_RESTS) {
            f += (m.young * m.ghost.x * fixed * ghosts[k]) * (rate_rests[b].xyz - rate_rests[a].xyz);
        }
    }
    return f;
}

// What a mass at a node changes along the direction, its own change `heavier` included.
fn by_mass(member: u32, node: u32, m: Member, r: Rate, mass: f32, heavier: f32) -> vec3<f32> {
    var f = heavier * acceleration(member, node, m);
    if call.mode != 0u {
        f += (heavier * m.mass_damping + mass * r.mass_damping) * speed(member, node);
    }
    return f - mass * r.gravity.xyz;
}

@compute @workgroup_size(64)
fn push_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let r = rates[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    var f = vec3(0.0);
    if with_rate(WITH_CELLS) {
        for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
            f += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        }
    }
    if shape.ghosts != 0u {
        f += by_ghosts(p.member, p.item, m, mix);
    }
    if has_mass_matrix() {
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            let mass = block_mass(m, p.member, k);
            var heavier = r.density * mass / m.density;
            if with_rate(WITH_DENSITIES) {
                heavier += m.density * rate_densities[p.member * shape.blocks + k];
            }
            f += by_mass(p.member, columns[k], m, r, mass, heavier);
        }
    } else {
        let mass = node_mass(m, p.member, p.item);
        var heavier = r.density * mass / m.density;
        if with_rate(WITH_DENSITIES) {
            heavier += m.density * rest[p.item].w * rate_densities[a];
        }
        f += by_mass(p.member, p.item, m, r, mass, heavier);
    }
    for (var s = 0u; s < shape.masses; s++) {
        let entry = entry_of(mass_stencil(s), p.item);
        if entry != NONE {
            let sum = acceleration_at(p.member, mass_stencil(s), m);
            let rate = rate_numbers[numbers_at(p.member) + PLANE_NUMBERS * shape.planes + s];
            f += stencil_entries[entry].weight * (rate * sum - mass_values[p.member * shape.masses + s] * r.gravity.xyz);
        }
    }
    column[a] = vec4(f, 0.0);
}
