//! Derivatives by what acts on nodes: the density at each, mass damping, gravity, and what multiplies the ghost penalty.
// use shared/mix
// use shared/inertia
// use shared/motion
// use shared/unstrained
// use shared/pulls

var<storage, read> probe: array<vec4<f32>>;
var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<body> ghosts: array<f32>;
// [B][N]: by the density at the node, or a node's part of that by the density of the whole.
var<storage, read_write> node_pulls: array<f32>;
// [2][B][workgroups]: by Young's modulus, Poisson's ratio and stiffness damping through the ghost penalty, by mass damping; by gravity.
var<storage, read_write> node_sums: array<vec4<f32>>;

// z times the ghost penalty's sum at the new state, the old one, and the stress-free shape.
fn ghosts_of(member: u32, node: u32, z: vec3<f32>) -> vec3<f32> {
    let a = at_node(member, node);
    var s = vec3(0.0);
    if shape.ghosts == 0u {
        return s;
    }
    for (var k = block_rows[node]; k < block_rows[node + 1u]; k++) {
        let b = at_node(member, columns[k]);
        let d1 = (next[b].xyz - next[a].xyz) + (next[part(1u) + b].xyz - next[part(1u) + a].xyz);
        s.x += ghosts[k] * dot(z, d1);
        if call.mode != 0u {
            let d0 = (now[b].xyz - now[a].xyz) + (now[part(1u) + b].xyz - now[part(1u) + a].xyz);
            s.y += ghosts[k] * dot(z, d0);
        }
        if has_rest() {
            s.z += ghosts[k] * dot(z, rests[b].xyz - rests[a].xyz);
        }
    }
    return s;
}

@compute @workgroup_size(64)
fn pull_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    var stiffness = vec4(0.0);
    var gravity = vec4(0.0);
    if p.live {
        let m = members[p.member];
        let mix = mix_of(m);
        let a = at_node(p.member, p.item);
        let z = probe[a].xyz;
        var carried = 0.0;
        if has_mass_matrix() {
            // Derivatives by the density of the whole body: pull_densities has those by places.
            var by = 0.0;
            for (var k = block_rows[p.item]; k < block_rows[p.item + 1u]; k++) {
                let mass = block_mass(m, p.member, k);
                carried += mass;
                by += mass * dot(z, acceleration(p.member, columns[k], m));
                if call.mode != 0u {
                    let speed = mass * dot(z, speed(p.member, columns[k]));
                    by += m.mass_damping * speed;
                    stiffness.w += speed;
                }
            }
            node_pulls[a] -= by / m.density;
        } else {
            let volume = rest[p.item].w;
            let mass = node_mass(m, p.member, p.item);
            var by = dot(z, acceleration(p.member, p.item, m));
            if call.mode != 0u {
                let speed = dot(z, speed(p.member, p.item));
                by += m.mass_damping * speed;
                stiffness.w = mass * speed;
            }
            node_pulls[a] -= volume * by;
            carried = mass;
        }
        for (var s = 0u; s < shape.masses; s++) {
            let entry = entry_of(mass_stencil(s), p.item);
            if entry != NONE {
                carried += mass_values[p.member * shape.masses + s] * stencil_entries[entry].weight;
            }
        }
        gravity = vec4(-carried * z, 0.0);
        let g = ghosts_of(p.member, p.item, z);
        let force = mix.on_ghost * g.x + (mix.old - mix.rate) * g.y - (mix.fresh + mix.old) * g.z;
        stiffness.x = m.ghost.x * force;
        stiffness.y = m.young * m.ghost.y * force;
        if call.mode != 0u {
            stiffness.z = m.young * m.ghost.x * (g.x - g.y) / shape.dt;
        }
    }
    let first = sum64(local, stiffness);
    let second = sum64(local, gravity);
    if local == 0u && p.live {
        node_sums[row_at(0u, p.member, p.item, shape.nodes, 64u)] -= first;
        node_sums[row_at(1u, p.member, p.item, shape.nodes, 64u)] -= second;
    }
}
