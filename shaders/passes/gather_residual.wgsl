//! Sums all forces per node at a trial: r, with the node's share of the potential in the fourth component. Inertia acts on the
//! increment beyond free flight alone, so nothing large cancels.
// use shared/mix
// use shared/inertia
// use shared/unstrained

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> trial: array<vec4<f32>>;
var<storage, read> cell_force: array<vec4<f32>>;
var<storage, read> old_force: array<vec4<f32>>;
var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
// [3][B][N]: the residual; elastic and support forces by themselves, for the size that it is compared with. In the fourth components the
// potential, its shares, and the node's mass with that of the points that it carries.
var<storage, read_write> residual: array<vec4<f32>>;

fn trial_at(member: u32, stencil: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        sum += stencil_entries[k].weight * trial[at_node(member, stencil_entries[k].node)].xyz;
    }
    return sum;
}

// Way of free flight.
fn flight_of(a: u32, m: Member) -> vec3<f32> {
    return shape.dt * now[part(2u) + a].xyz + shape.theta * shape.dt * shape.dt * m.gravity.xyz;
}

@compute @workgroup_size(64)
fn gather_residual(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    let w = trial[a].xyz;
    var elastic = vec4(0.0);
    var support = vec4(0.0);
    for (var k = node_rows[p.item]; k < node_rows[p.item + 1u]; k++) {
        let c = p.member * shape.cells * 8u + node_list[k];
        elastic += cell_force[c];
        support += cell_force[support_part() + c];
    }
    let mass = node_mass(m, p.member, p.item);
    var body = vec4(0.0);
    if call.mode != 0u {
        let before = old_force[a].xyz;
        elastic += vec4(before, dot(before, w));
        let flight = flight_of(a, m);
        body = mass * vec4(mix.inertia * w + mix.drag * (flight + w),
                           0.5 * (mix.inertia + mix.drag) * dot(w, w) + mix.drag * dot(flight, w));
    } else {
        body = -mass * vec4(m.gravity.xyz, dot(m.gravity.xyz, w));
    }
    if has_mass_matrix() {
        body = vec4(0.0);
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            let b = at_node(p.member, columns[k]);
            var pull = -m.gravity.xyz;
            var potential = -m.gravity.xyz;
            if call.mode != 0u {
                let there = trial[b].xyz;
                let flight = flight_of(b, m);
                pull = mix.inertia * there + mix.drag * (flight + there);
                potential = 0.5 * (mix.inertia + mix.drag) * there + mix.drag * flight;
            }
            body += block_mass(m, p.member, k) * vec4(pull, dot(potential, w));
        }
    }
    var carried = mass;
    for (var s = 0u; s < shape.masses; s++) {
        let entry = entry_of(mass_stencil(s), p.item);
        if entry != NONE {
            var pull = -m.gravity.xyz;
            var twice = 2.0;
            if call.mode != 0u {
                pull = mix.inertia * trial_at(p.member, mass_stencil(s));
                twice = 1.0;
            }
            let f = mass_values[p.member * shape.masses + s] * stencil_entries[entry].weight;
            carried += f;
            body += f * vec4(pull, 0.5 * twice * dot(pull, w));
        }
    }
    if shape.ghosts != 0u {
        let scale = m.young * m.ghost.x * mix.on_ghost;
        for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
            let b = at_node(p.member, columns[k]);
            let d = (next[b].xyz - next[a].xyz) + (next[part(1u) + b].xyz - next[part(1u) + a].xyz);
            // Rows of the penalty sum to zero: uᵀGu = −½ Σ G_ab |u_a − u_b|².
            elastic += (scale * ghosts[k]) * vec4(d, -0.25 * dot(d, d));
            if has_rest() {
                // The penalty is on u − W; as a force that does not change its potential is linear.
                let s = (m.young * m.ghost.x * (mix.fresh + mix.old) * ghosts[k]) * (rests[b].xyz - rests[a].xyz);
                elastic -= vec4(s, dot(s, w));
            }
        }
    }
    residual[a] = elastic + support + body;
    residual[part(1u) + a] = vec4(elastic.xyz, abs(elastic.w) + abs(support.w) + abs(body.w));
    residual[part(2u) + a] = vec4(support.xyz, carried);
}
