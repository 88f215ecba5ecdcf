//! ∂r/∂p per node: corners of cells from press_column, and what acts on nodes. call.extra = kind + KEYS · index + OF_CELLS if
//! cells take part. For initial velocities it is ∂v/∂p of the start.
// use shared/mix
// use shared/inertia
// use shared/keys
// use shared/unstrained

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> cell_force: array<vec4<f32>>;
var<storage, read> node_rows: array<u32>;
var<storage, read> node_list: array<u32>;
var<storage, read> block_rows: array<u32>;
var<storage, read> columns: array<u32>;
var<storage, read> ghosts: array<f32>;
// [B][rows][N]: derivatives of the nodes' factors on the density.
var<storage, read> density_slopes: array<f32>;
var<storage, read_write> column: array<vec4<f32>>;

fn axis(k: u32) -> vec3<f32> {
    return vec3(f32(k == 0u), f32(k == 1u), f32(k == 2u));
}

// w/(θΔt²), w the increment beyond free flight: the acceleration that forces caused, minus gravity's share; static: −g.
fn pull(member: u32, node: u32, m: Member) -> vec3<f32> {
    if call.mode == 0u {
        return -m.gravity.xyz;
    }
    let v = part(2u) + at_node(member, node);
    return (next[v].xyz - now[v].xyz) / shape.dt - m.gravity.xyz;
}

// (u₁ − u₀)/Δt.
fn speed(member: u32, node: u32) -> vec3<f32> {
    let a = at_node(member, node);
    return ((next[a].xyz - now[a].xyz) + (next[part(1u) + a].xyz - now[part(1u) + a].xyz)) / shape.dt;
}

// Factors of the ghost penalty at the new and old state, and at the stress-free shape (or its derivative).
fn ghost_factors(kind: u32, m: Member, mix: Mix) -> vec3<f32> {
    let fixed = select(0.0, -mix.fresh - mix.old, has_rest());
    let both = vec3(mix.on_ghost, mix.old - mix.rate, fixed);
    switch kind {
        case YOUNGS_MODULUS: { return m.ghost.x * both; }
        case POISSON_RATIO: { return m.young * m.ghost.y * both; }
        case STIFFNESS_DAMPING: { return m.young * m.ghost.x * vec3(1.0, -1.0, 0.0) / shape.dt; }
        case REST_SLOPE: { return m.young * m.ghost.x * vec3(0.0, 0.0, fixed); }
        default: { return vec3(0.0); }
    }
}

@compute @workgroup_size(64)
fn gather_column(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let kind = call.extra % KEYS;
    let index = (call.extra % OF_CELLS) / KEYS;
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    var f = vec3(0.0);
    if call.extra >= OF_CELLS {
        for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
            f += cell_force[p.member * shape.cells * 8u + node_list[k]].xyz;
        }
    }
    let ghost = ghost_factors(kind, m, mix);
    if shape.ghosts != 0u && (ghost.x != 0.0 || ghost.z != 0.0) {
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            let b = at_node(p.member, columns[k]);
            let d1 = (next[b].xyz - next[a].xyz) + (next[part(1u) + b].xyz - next[part(1u) + a].xyz);
            f += (ghost.x * ghosts[k]) * d1;
            if call.mode != 0u {
                let d0 = (now[b].xyz - now[a].xyz) + (now[part(1u) + b].xyz - now[part(1u) + a].xyz);
                f += (ghost.y * ghosts[k]) * d0;
            }
            if ghost.z != 0.0 {
                var d = vec3(0.0);
                if kind == REST_SLOPE {
                    d = rest_slope(index, b) - rest_slope(index, a);
                } else {
                    d = rests[b].xyz - rests[a].xyz;
                }
                f += (ghost.z * ghosts[k]) * d;
            }
        }
    }
    let volume = rest[p.item].w;
    switch kind {
        case DENSITY, DENSITY_SLOPE: {
            var mass = node_mass(m, p.member, p.item) / m.density;
            if kind == DENSITY_SLOPE {
                mass = m.density * volume * density_slopes[(p.member * shape.slope_rows + index) * shape.nodes + p.item];
            }
            f += mass * pull(p.member, p.item, m);
            if call.mode != 0u {
                f += (mass * m.mass_damping) * speed(p.member, p.item);
            }
        }
        case MASS_DAMPING: {
            if call.mode != 0u {
                f += node_mass(m, p.member, p.item) * speed(p.member, p.item);
            }
        }
        case GRAVITY: {
            var mass = node_mass(m, p.member, p.item);
            for (var s = 0u; s < shape.masses; s++) {
                let corner = mass_corner(s, p.item);
                if corner < 8u {
                    mass += mass_values[p.member * shape.masses + s] * mass_sites[s].weights[corner];
                }
            }
            f -= mass * axis(index);
        }
        case POINT_MASS: {
            let corner = mass_corner(index, p.item);
            if corner < 8u {
                var sum = vec3(0.0);
                for (var j = 0u; j < 8u; j++) {
                    sum += mass_sites[index].weights[j] * pull(p.member, mass_sites[index].nodes[j], m);
                }
                f += mass_sites[index].weights[corner] * sum;
            }
        }
        case VELOCITY: { f = axis(index); }
        case ANGULAR_VELOCITY: {
            var arm = rest[p.item].xyz - shape.pivot;
            if starts_unstrained() {
                arm += rests[a].xyz;
            }
            f = cross(axis(index), arm);
        }
        case START_SHAPE: { f = rest_slope(index, a); }
        case START_SPIN: { f = cross(m.spin.xyz, rest_slope(index, a)); }
        default: {}
    }
    column[a] = vec4(f, 0.0);
}
