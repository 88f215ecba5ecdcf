//! Inverts every node's own 3 × 3 block, inertia included: the preconditioner, and the norm in which residuals are measured (`shared/inverse`). The
//! trial that the matrix belongs to becomes the increment. And what begin_solve decides by, in parts: the sizes of the forces that the residual is
//! the sum of; its own, blocks that are not positive definite, and traces.
// use shared/mix
// use shared/inertia
// use shared/finite
// use shared/inverse
// use shared/held
// use shared/team_64
// use shared/totals
// use shared/node_parts

var<storage, read> values: array<f32>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> residual: array<vec4<f32>>;
var<storage, read> trial: array<vec4<f32>>;
var<body> diagonals: array<u32>;
var<storage, read_write> increment: array<vec4<f32>>;
var<storage, read_write> inverses: array<vec4<f32>>;

// The inverse of a node's block.
struct Inverse {
    upper: vec4<f32>,
    lower: vec4<f32>,
}

fn size_of(own: Inverse, force: vec3<f32>) -> f32 {
    return dot(force, by_inverse(own.upper, own.lower, force));
}

fn inverse_of(p: Place) -> Inverse {
    let m = members[p.member];
    let mix = mix_of(m);
    var mass = node_mass(m, p.member, p.item);
    if has_mass_matrix() {
        mass = block_mass(m, p.member, diagonals[p.item]);
    }
    for (var s = 0u; s < shape.masses; s++) {
        let entry = entry_of(mass_stencil(s), p.item);
        if entry != NONE {
            let w = stencil_entries[entry].weight;
            mass += mass_values[p.member * shape.masses + s] * w * w;
        }
    }
    let v = (p.member * shape.blocks + diagonals[p.item]) * 9u;
    let added = mass * mix.inertia;
    let trace = values[v] + values[v + 4u] + values[v + 8u];
    // What rounding is measured by: nothing is balanced where a node is held, be its springs as stiff as they may.
    var felt = trace;
    if shape.held != 0u && is_held(p.member, p.item) {
        felt = 0.0;
    }
    // In units of its trace, so that the determinant of a sliver's block does not underflow.
    let unit = trace + 3.0 * added;
    let xx = (values[v] + added) / unit;
    let xy = values[v + 1u] / unit;
    let xz = values[v + 2u] / unit;
    let yy = (values[v + 4u] + added) / unit;
    let yz = values[v + 5u] / unit;
    let zz = (values[v + 8u] + added) / unit;
    let cx = yy * zz - yz * yz;
    let cy = xz * yz - xy * zz;
    let cz = xy * yz - xz * yy;
    let det = xx * cx + xy * cy + xz * cz;
    if is_finite(det) && is_finite(unit) && unit > 0.0 && xx > 0.0 && xx * yy - xy * xy > 0.0 && det > 0.0 {
        let s = 1.0 / (det * unit);
        return Inverse(vec4(cx, cy, cz, xx * zz - xz * xz) * s,
                       vec4((xy * xz - xx * yz) * s, (xx * yy - xy * xy) * s, felt, 0.0));
    }
    return Inverse(vec4(0.0), vec4(0.0, 0.0, felt, 1.0));
}

@compute @workgroup_size(64)
fn invert_diagonal(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, 64u);
    if !share.runs {
        return;
    }
    let p = place_in(share, local, shape.nodes);
    var forces = vec4(0.0);
    var state = vec4(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        let own = inverse_of(p);
        inverses[2u * a] = own.upper;
        inverses[2u * a + 1u] = own.lower;
        increment[a] = trial[a];
        let mass = residual[part(2u) + a].w;
        let weight = mass * members[p.member].gravity.xyz;
        var momentum = vec3(0.0);
        if call.mode != 0u {
            momentum = mass * now[part(2u) + a].xyz / (shape.theta * shape.dt);
        }
        forces = vec4(size_of(own, weight), size_of(own, momentum), size_of(own, residual[part(1u) + a].xyz),
                      size_of(own, residual[part(2u) + a].xyz));
        state = vec4(size_of(own, residual[a].xyz), own.lower.w, abs(own.lower.z), 0.0);
    }
    keep_part(local, share, 0u, total(local, forces));
    keep_part(local, share, 1u, total(local, state));
}
