//! Derivatives by what acts at elastic points: the modulus of each, Poisson's ratio, stiffness damping, numbers of changes in time.
// use shared/elastic_way
// use shared/pulls

// [B][points]: by the factor on its element's modulus.
var<storage, read_write> elastic_pulls: array<f32>;
// [CELL_ROWS + rows of aging][B][points]: by Poisson's ratio, stiffness damping, the viscosity's coefficient and exponent first. The host sums them: a
// barrier beside a stress would have software adapters split a large function at it, which takes them minutes.
var<storage, read_write> elastic_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let way = elastic_way(p.member, p.item, m, mix_of(m));
    let z = gradient_probe(p.member, p.item) * volume_at(p.member, p.item);
    let whole = contract(z, way.stress);
    let young = young_at(m, p.member, element_of(p.item));
    elastic_pulls[p.member * shape.elastic + p.item] -= unvaried(m, p.member) * whole;
    elastic_sums[row_at(0u, p.member, p.item, shape.elastic, 1u)] -= young * contract(z, way.by_poisson);
    if call.mode != 0u {
        elastic_sums[row_at(1u, p.member, p.item, shape.elastic, 1u)] -= young * contract(z, way.viscous) / shape.dt;
    }
    elastic_sums[row_at(2u, p.member, p.item, shape.elastic, 1u)] -= contract(z, way.by_coefficient);
    elastic_sums[row_at(3u, p.member, p.item, shape.elastic, 1u)] -= contract(z, way.by_exponent);
    for (var row = 0u; row < shape.aging_rows; row++) {
        let slope = aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
        elastic_sums[row_at(CELL_ROWS + row, p.member, p.item, shape.elastic, 1u)] -= slope * young * whole;
    }
}
