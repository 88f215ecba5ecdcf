//! Conjugate gradients by many workgroups, first of an iteration: has it converged? If not, p = z + β p and q = A p with the assembled matrix,
//! eight lanes a row so that neighbouring lanes read neighbouring blocks; and parts of pᵀ q.
// use shared/mix
// use shared/team_256
// use shared/totals
// use shared/turn
// use shared/product

var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<storage, read> values: array<f32>;
var<storage, read_write> solving: array<vec4<f32>>;

@compute @workgroup_size(256)
fn multiply_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let share = find_share(group, groups, shape.nodes, NARROW);
    if !share.runs {
        return;
    }
    if turn_cg(local, share.member, share.first == 0u).z != 0.0 {
        return;
    }
    let p = place_in(share, local / 8u, shape.nodes);
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var q = vec3(0.0);
    if p.live {
        let end = block_rows[p.item + 1u];
        for (var k = block_rows[p.item] + local % 8u; k < end; k += 8u) {
            let x = along_way(at_node(p.member, columns[k]));
            let v = (p.home * shape.blocks + k) * 9u;
            q += vec3(
                values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
                values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
                values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
            );
            if has_mass_matrix() {
                q += (inertia * block_mass(m, p.home, k)) * x;
            }
        }
    }
    shares[local] = vec4(q, 0.0);
    workgroupBarrier();
    var curvature = vec4(0.0);
    if p.live && local % 8u == 0u {
        q = heavy_row(m, inertia, p);
        for (var i = 0u; i < 8u; i++) {
            q += shares[local + i].xyz;
        }
        let a = at_node(p.member, p.item);
        let way = along_way(a);
        solving[way_now() + a] = vec4(way, 0.0);
        solving[solving_part(IMAGE) + a] = vec4(q, 0.0);
        curvature.x = dot(way, q);
    }
    let bend = total(local, curvature).x;
    if local == 0u {
        cg_sums[bends_at(p.member) + share.first / NARROW] = vec4(bend, 0.0, 0.0, 0.0);
    }
}
