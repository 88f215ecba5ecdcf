//! Adds the tangent of laws of cells to that of every element's mean, which tangent_elastic left. Where the convex part is wanted, what bends with
//! the rotation is left out: the rest is convex where the laws are.
// use shared/tet_question
// use shared/still_numbers
// use shared/elastic_asks

var<storage, read> newton: array<Newton>;
var<storage, read_write> elastic_tangents: array<f32>;

@compute @workgroup_size(64)
fn tangent_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let point = mean_point(p.item);
    let a = stretch_at(gradient_next(p.member, point));
    var q: Question;
    q.strain = a.strain;
    q.past = past_stretch(p.member, p.item);
    q.weight = mix_of(m).fresh;
    q.lossy = call.mode != 0u;
    q.majorised = newton[p.member].majorised != 0u;
    // T, and its changes with the components of ε.
    var t = mat3x3<f32>();
    var by: array<mat3x3<f32>, 6>;
    for (var c = 0u; c < 6u; c++) {
        q.dstrain = unit_strain(c);
        let said = ask_laws(m, p.member, q);
        t = said.t;
        by[c] = said.change;
    }
    let scale = young_at(m, p.member, p.item) * volume_at(p.member, point);
    let convex = newton[p.member].convex != 0u;
    for (var column = 0u; column < 9u; column++) {
        var df = mat3x3<f32>();
        df[column % 3u][column / 3u] = 1.0;
        let e = strain_along(a, df);
        let dt = by[0] * e[0].x + by[1] * e[1].y + by[2] * e[2].z + by[3] * e[1].z + by[4] * e[2].x + by[5] * e[0].y;
        var change = stress_back(a, dt);
        if !convex {
            change += stress_bend(a, t, df);
        }
        let at = (p.member * shape.elastic + point) * TANGENT_NUMBERS + 9u * column;
        for (var row = 0u; row < 9u; row++) {
            elastic_tangents[at + row] += scale * component(change, row);
        }
    }
}
