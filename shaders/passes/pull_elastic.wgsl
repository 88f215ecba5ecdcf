//! Derivatives by what acts at elastic points: the modulus of each, Poisson's ratio, stiffness damping, numbers of changes in time.
// use shared/elastic_way
// use shared/pulls

// [B][points]: by the factor on its element's modulus.
var<storage, read_write> elastic_pulls: array<f32>;
// [CELL_ROWS + rows of aging][B][workgroups]: by Poisson's ratio, stiffness damping, the viscosity's coefficient and exponent first.
var<storage, read_write> elastic_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    var by = vec4(0.0);
    var flow = vec2(0.0);
    if p.live {
        let m = members[p.member];
        let way = elastic_way(p.member, p.item, m, mix_of(m));
        let z = gradient_probe(p.member, p.item) * elastic_volumes[p.item];
        let whole = contract(z, way.stress);
        elastic_pulls[p.member * shape.elastic + p.item] -= unvaried(m, p.member) * whole;
        let young = young_at(m, p.member, element_of(p.item));
        by = young * vec4(whole, contract(z, way.by_poisson), 0.0, 0.0);
        if call.mode != 0u {
            by.z = young * contract(z, way.viscous) / shape.dt;
        }
        flow = vec2(contract(z, way.by_coefficient), contract(z, way.by_exponent));
    }
    by.w = flow.x;
    let sum = sum64(local, by);
    let exponents = sum64(local, vec4(flow.y, 0.0, 0.0, 0.0)).x;
    if local == 0u && p.live {
        elastic_sums[row_at(0u, p.member, p.item, shape.elastic, 64u)] -= sum.y;
        elastic_sums[row_at(1u, p.member, p.item, shape.elastic, 64u)] -= sum.z;
        elastic_sums[row_at(2u, p.member, p.item, shape.elastic, 64u)] -= sum.w;
        elastic_sums[row_at(3u, p.member, p.item, shape.elastic, 64u)] -= exponents;
        for (var row = 0u; row < shape.aging_rows; row++) {
            let slope = aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
            elastic_sums[row_at(CELL_ROWS + row, p.member, p.item, shape.elastic, 64u)] -= slope * sum.x;
        }
    }
}
