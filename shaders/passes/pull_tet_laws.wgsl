//! Derivatives by what laws of cells say at an element, added to those of pull_elastic: by the modulus, Poisson's ratio, numbers of changes in
//! time, and the laws' own numbers.
// use effects/tets
// use shared/pulls

// As pull_elastic has them.
var<storage, read_write> elastic_pulls: array<f32>;
var<storage, read_write> elastic_sums: array<f32>;
// [laws][CELL_SLOTS][B][elements].
var<storage, read_write> law_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let point = mean_point(p.item);
    let z = gradient_probe(p.member, point);
    let young = young_at(m, p.member, p.item);
    let unit = young * volume_at(p.member, point);
    step_rate = 1.0 / shape.dt;
    let past = past_stretch(p.member, p.item);
    var own = 0.0;
    var poisson = 0.0;
    // Energy at the new state, what is lost, energy at the old state.
    for (var instant = 0u; instant < 3u; instant++) {
        let part = select(ENERGY_PART, LOSS_PART, instant == 1u);
        let old = instant == 2u;
        if (part == LOSS_PART && call.mode == 0u) || (old && mix.old == 0.0) {
            continue;
        }
        let weight = select(select(1.0, mix.fresh, instant == 0u), mix.old, old);
        let a = stretch_at(gradient_of(p.member, point, old));
        var asked: Asked;
        asked.x = a.strain - past * f32(part == LOSS_PART);
        asked.past = past;
        asked.first = strain_along(a, z);
        asked.lame = m.lame.xy;
        for (var k = 0u; k < MOST_LAWS; k++) {
            if k >= law_count() {
                break;
            }
            let effect = cell_effects[k];
            // Poisson's ratio, then the law's numbers.
            for (var along = 0u; along < 9u; along++) {
                if along > effect.count {
                    break;
                }
                for (var i = SCALARS; i < CELL_INPUTS; i++) {
                    input[i] = number(0.0);
                    if i - SCALARS < effect.count {
                        let value = effect_values[p.member * effect.stride + effect.first + i - SCALARS];
                        input[i] = vec4(value, 0.0, f32(along == i - SCALARS + 1u), 0.0);
                    }
                }
                asked.dlame = m.lame.zw * f32(along == 0u);
                put_scalars(part, asked);
                let v = cell_law(effect.law, part) * weight;
                if along == 0u {
                    own += v.y;
                    poisson += v.w;
                } else {
                    law_sums[row_at(CELL_SLOTS * k + along - 1u, p.member, p.item, shape.elements, 1u)] -= unit * v.w;
                }
            }
        }
    }
    elastic_pulls[p.member * shape.elastic + point] -= unvaried(m, p.member) * volume_at(p.member, point) * own;
    elastic_sums[row_at(0u, p.member, point, shape.elastic, 1u)] -= unit * poisson;
    for (var row = 0u; row < shape.aging_rows; row++) {
        let slope = aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
        elastic_sums[row_at(CELL_ROWS + row, p.member, point, shape.elastic, 1u)] -= slope * unit * own;
    }
}
