//! Adds the derivative of the stress of laws of cells by a past state, times the vector `probe` (ALONG), or its transpose, to what
//! couple_elastic left; `now` is that state. Or that of the stress-free shape, as there.
// use shared/tet_question
// use shared/still_numbers
// use shared/asks

var<storage, read_write> elastic_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn couple_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let point = mean_point(p.item);
    let f0 = identity3() + gradient_now(p.member, point);
    var d = gradient_probe(p.member, point);
    let transposed = (call.extra & TRANSPOSED) != 0u;
    let of_shape = (call.extra & OF_SHAPE) != 0u;
    if of_shape && !transposed {
        d = f0 * d * -1.0;
    }
    var sides: array<Stretch, 2>;
    for (var side = 0u; side < 2u; side++) {
        sides[side] = stretch_at(gradient_of(p.member, point, side == 0u));
    }
    let old = sides[0];
    let fresh = sides[1];
    var stress = mat3x3<f32>();
    // What is lost, and the old state's own stress, whose derivative is symmetric.
    for (var own = 0u; own < 2u; own++) {
        var q: Question;
        if own == 1u {
            q.strain = old.strain;
            q.dstrain = strain_along(old, d);
            q.weight = mix.old;
        } else {
            q.strain = fresh.strain;
            q.past = past_stretch(p.member, p.item);
            q.lossy = true;
            q.by_past = transposed;
            if q.by_past {
                q.dstrain = strain_along(fresh, d);
            } else {
                q.dpast = strain_along(old, d);
            }
        }
        let said = ask_laws(m, p.member, q);
        if own == 1u {
            stress += stress_back(old, said.change) + stress_bend(old, said.t, d);
        } else if q.by_past {
            stress += stress_back(old, said.change);
        } else {
            stress += stress_back(fresh, said.change);
        }
    }
    if of_shape && transposed {
        stress = transpose(f0) * stress * -1.0;
    }
    let scale = young_at(m, p.member, p.item) * volume_at(p.member, point);
    let at = stress_place(p.member, point);
    for (var c = 0u; c < 3u; c++) {
        elastic_stress[at + c] += vec4(scale * stress[c], 0.0);
    }
}
