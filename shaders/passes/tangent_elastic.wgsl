//! Tangent of every elastic point times its volume, ∂P_ik/∂F_jl. Where the convex part is wanted, a linear material in Green's strain stands for
//! the one at hand: it has no negative curvature whatever F is, and knows rotations.
// use shared/elastic
// use shared/viscous
// use shared/elastic_asks

var<storage, read> newton: array<Newton>;
// [B][points][81]: column 3j + l after column, in each 3i + k.
var<storage, read_write> elastic_tangents: array<f32>;

@compute @workgroup_size(64)
fn tangent_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let lame = lame_at(m, p.item).xy;
    let h = gradient_next(p.member, p.item);
    let f = identity3() + h;
    let scale = young_at(m, p.member, element_of(p.item)) * volume_at(p.member, p.item);
    let convex = newton[p.member].convex != 0u;
    var held = mat3x3<f32>();
    if mix.rate != 0.0 {
        held = linear_stress(strained(p.member, p.item, h), lame);
    }
    var flow = flow_at(m, p.member, p.item, h);
    flow.along = of_dissipation(newton[p.member].majorised != 0u, flow.along);
    for (var column = 0u; column < 9u; column++) {
        var dh = mat3x3<f32>();
        dh[column % 3u][column / 3u] = 1.0;
        let dg = green_rate(f, dh);
        let along = f * linear_stress(dg, lame);
        var flowing = f * flow_rate(flow, dg);
        var change = along * (mix.fresh + mix.rate);
        if !convex {
            change = respond_at(h, dh, lame, vec2(0.0)).change * mix.fresh + (dh * held + along) * mix.rate;
            flowing += dh * flow.stress;
        }
        let at = (p.member * shape.elastic + p.item) * TANGENT_NUMBERS + 9u * column;
        for (var row = 0u; row < 9u; row++) {
            elastic_tangents[at + row] = scale * component(change, row) + volume_at(p.member, p.item) * component(flowing, row);
        }
    }
}
