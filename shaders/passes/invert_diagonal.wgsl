//! Inverts every node's own 3 × 3 block, inertia included: the preconditioner, and the norm in which residuals are measured.
//! Two vectors per node: (xx, xy, xz, yy), (yz, zz, trace without inertia, 1 if not positive definite).
// use shared/mix
// use shared/inertia
// use shared/finite

var<storage, read> values: array<f32>;
var<body> diagonals: array<u32>;
var<storage, read_write> inverses: array<vec4<f32>>;

@compute @workgroup_size(64)
fn invert_diagonal(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
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
    let a = 2u * at_node(p.member, p.item);
    if is_finite(det) && is_finite(unit) && unit > 0.0 && xx > 0.0 && xx * yy - xy * xy > 0.0 && det > 0.0 {
        let s = 1.0 / (det * unit);
        inverses[a] = vec4(cx, cy, cz, xx * zz - xz * xz) * s;
        inverses[a + 1u] = vec4((xy * xz - xx * yz) * s, (xx * yy - xy * xy) * s, trace, 0.0);
    } else {
        inverses[a] = vec4(0.0);
        inverses[a + 1u] = vec4(0.0, 0.0, trace, 1.0);
    }
}
